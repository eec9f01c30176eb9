//! Both algorithms learn what they should be able to learn: a task that needs memory, and one that
//! needs control.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::env::Env;
use searoom::nn::Compute;
use searoom::rl::agent::Algorithm;
use searoom::rl::replay::{Batch, ReplayShape};
use searoom::rl::trainer::{Trainer, TrainerConfig};

use super::tasks::{config, recall_cue, tracking};

/// Mean return of the trained agent on evaluation seeds.
fn train(config: TrainerConfig, make: fn() -> Box<dyn Env>, steps: u64) -> f64 {
    let mut trainer = Trainer::new(config, make(), Compute::new(1));
    while trainer.step() < steps {
        trainer.advance();
    }
    trainer.evaluate(make().as_mut()).mean_return()
}

#[test]
fn td3_recalls_a_cue() {
    let score = train(config(Algorithm::LstmTd3), recall_cue, 5000);
    assert!(score > -0.05, "{score}");
}

#[test]
fn sac_recalls_a_cue() {
    let score = train(config(Algorithm::LstmSac), recall_cue, 5000);
    assert!(score > -0.05, "{score}");
}

/// The cue cannot be recalled without history: the task does need memory.
#[test]
fn without_history_the_cue_is_lost() {
    let mut config = config(Algorithm::LstmSac);
    config.agent.history_len = 0;
    let score = train(config, recall_cue, 3000);
    assert!(score < -0.5, "{score}");
}

/// An agent that moves at full speed until it is there loses 0.1 per step of distance over at most ten
/// steps: about -1.6 on average. Standing still costs -20.
#[test]
fn td3_tracks_a_mark() {
    let score = train(config(Algorithm::LstmTd3), tracking, 6000);
    assert!(score > -3.0, "{score}");
}

#[test]
fn sac_tracks_a_mark() {
    let score = train(config(Algorithm::LstmSac), tracking, 6000);
    assert!(score > -3.0, "{score}");
}

/// The limit of 30 decisions ends nothing, unless the settings say that it does: then a share of 1 in 30.
#[test]
fn values_reach_beyond_the_time_limit_where_they_should() {
    for (bootstraps, ends) in [(true, 0.0..=0.0), (false, 0.02..=0.05)] {
        let settings = TrainerConfig { bootstrap_at_time_limit: bootstraps, ..config(Algorithm::LstmTd3) };
        let mut trainer =
            Trainer::new(TrainerConfig { random_steps: 300, ..settings }, tracking(), Compute::new(1));
        for _ in 0..300 {
            trainer.advance();
        }
        let mut batch =
            Batch::new(&ReplayShape { observation_len: 2, action_len: 1, capacity: 300 }, 5000, 4);
        assert!(trainer.replay().sample(&mut ChaCha8Rng::seed_from_u64(1), &mut batch));
        let share = 1.0 - batch.continues.iter().sum::<f32>() / 5000.0;
        assert!(
            ends.contains(&share),
            "bootstrap {bootstraps}: the value ends in {share} of all transitions"
        );
    }
}

#[test]
fn equal_seeds_give_equal_bits_on_any_number_of_threads() {
    let weights = |threads: usize| {
        let mut trainer = Trainer::new(config(Algorithm::LstmSac), tracking(), Compute::new(threads));
        while trainer.step() < 700 {
            trainer.advance();
        }
        trainer.agent().networks().map(|network| network.online.values().to_vec())
    };
    let first = weights(1);
    assert_eq!(first, weights(1));
    assert_eq!(first, weights(2));
}

#[test]
fn a_restored_trainer_goes_on_with_the_same_bits() {
    for algorithm in [Algorithm::LstmTd3, Algorithm::LstmSac] {
        let mut straight = Trainer::new(config(algorithm), tracking(), Compute::new(1));
        while straight.step() < 617 {
            straight.advance();
        }
        let state = straight.state();
        let replay = straight.replay().clone();
        let agent = straight.agent().clone();

        let mut restored =
            Trainer::new(TrainerConfig { seed: 99, ..config(algorithm) }, tracking(), Compute::new(1));
        *restored.agent() = agent;
        assert!(restored.restore(state, replay));
        for _ in 0..100 {
            assert_eq!(straight.advance(), restored.advance());
        }
        let [ours, theirs] = [&mut straight, &mut restored]
            .map(|trainer| trainer.agent().networks().map(|network| network.online.values().to_vec()));
        assert_eq!(ours, theirs);
        assert_eq!(straight.state(), restored.state());
    }
}
