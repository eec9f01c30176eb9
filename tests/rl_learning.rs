//! Both algorithms learn what they should be able to learn: a task that needs memory, and one that
//! needs control. Networks are small and rates fast, so that this takes seconds.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::env::{ActionError, Env, RewardTerm, Step};
use searoom::nn::Compute;
use searoom::rl::agent::{AgentConfig, Algorithm};
use searoom::rl::sac::SacConfig;
use searoom::rl::td3::Td3Config;
use searoom::rl::trainer::{Trainer, TrainerConfig};

/// A cue of either sign is shown once; three decisions later the action has to repeat it. Nothing
/// that is seen in between tells it: without memory the best return is -1.
struct RecallCue {
    cue: f32,
    step: usize,
    terms: [RewardTerm; 1],
}

impl RecallCue {
    const DECISIONS: usize = 4;

    fn new() -> Self {
        Self { cue: 0.0, step: 0, terms: [RewardTerm { name: "miss", value: 0.0 }] }
    }

    fn observe(&self, observation: &mut [f32]) {
        observation[0] = if self.step == 0 { self.cue } else { 0.0 };
        observation[1] = if self.step + 1 == Self::DECISIONS { 1.0 } else { 0.0 };
    }
}

impl Env for RecallCue {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        1
    }

    fn max_decisions(&self) -> usize {
        Self::DECISIONS
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        self.cue = if ChaCha8Rng::seed_from_u64(seed).random() { 1.0 } else { -1.0 };
        self.step = 0;
        self.observe(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        self.step += 1;
        let asked = self.step == Self::DECISIONS;
        let miss = if asked { -f64::from(action[0] - self.cue).powi(2) } else { 0.0 };
        self.terms[0].value = miss;
        self.observe(observation);
        Ok(Step { reward: miss, terminated: asked, truncated: false })
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        &self.terms
    }
}

/// A point on a line is moved by the action and has to be kept at a mark that differs by episode.
struct Tracking {
    place: f64,
    mark: f64,
    step: usize,
    terms: [RewardTerm; 1],
}

impl Tracking {
    const DECISIONS: usize = 30;

    fn new() -> Self {
        Self { place: 0.0, mark: 0.0, step: 0, terms: [RewardTerm { name: "distance", value: 0.0 }] }
    }

    fn observe(&self, observation: &mut [f32]) {
        observation[0] = self.place as f32;
        observation[1] = self.mark as f32;
    }
}

impl Env for Tracking {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        1
    }

    fn max_decisions(&self) -> usize {
        Self::DECISIONS
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        self.place = rng.random_range(-1.0..1.0);
        self.mark = rng.random_range(-1.0..1.0);
        self.step = 0;
        self.observe(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        self.place += 0.2 * f64::from(action[0].clamp(-1.0, 1.0));
        self.step += 1;
        let distance = -(self.place - self.mark).abs();
        self.terms[0].value = distance;
        self.observe(observation);
        Ok(Step { reward: distance, terminated: false, truncated: self.step == Self::DECISIONS })
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        &self.terms
    }
}

fn config(algorithm: Algorithm) -> TrainerConfig {
    let rate = 2e-3;
    TrainerConfig {
        seed: 3,
        replay_capacity: 20_000,
        random_steps: 500,
        evaluation_episodes: 20,
        agent: AgentConfig {
            algorithm,
            hidden: 32,
            td3: Td3Config {
                actor_learning_rate: rate,
                critic_learning_rate: rate,
                target_rate: 0.02,
                ..Td3Config::default()
            },
            sac: SacConfig {
                actor_learning_rate: rate,
                critic_learning_rate: rate,
                temperature_learning_rate: rate,
                target_rate: 0.02,
                ..SacConfig::default()
            },
            ..AgentConfig::default()
        },
        ..TrainerConfig::default()
    }
}

/// Mean return of the trained agent on evaluation seeds.
fn train(config: TrainerConfig, make: fn() -> Box<dyn Env>, steps: u64) -> f64 {
    let mut trainer = Trainer::new(config, make(), Compute::new(1));
    while trainer.step() < steps {
        trainer.advance();
    }
    trainer.evaluate(make().as_mut()).mean_return()
}

fn recall_cue() -> Box<dyn Env> {
    Box::new(RecallCue::new())
}

fn tracking() -> Box<dyn Env> {
    Box::new(Tracking::new())
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
