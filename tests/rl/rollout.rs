//! Episodes side by side are the episodes one by one, bit for bit.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::env::{ActionError, Env};
use searoom::nn::Compute;
use searoom::rl::agent::{Agent, Algorithm};
use searoom::rl::rollout::{AgentBatch, BatchPolicy, NoAction, RolledEpisode, Rollout, UniformActions};
use searoom::rl::trainer::run_episode;

use super::tasks::{config, recall_cue, tracking};

const SEEDS: [u64; 7] = [3, 1, 4, 1, 5, 9, 2];

fn agent(algorithm: Algorithm, env: &dyn Env) -> Agent {
    let rng = &mut ChaCha8Rng::seed_from_u64(8);
    Agent::new(config(algorithm).agent, env.observation_len(), env.action_len(), rng)
}

fn copies(make: fn() -> Box<dyn Env>, rows: usize) -> Rollout<Box<dyn Env>> {
    Rollout::new((0..rows).map(|_| make()).collect())
}

fn run(rollout: &mut Rollout<Box<dyn Env>>, policy: &mut dyn BatchPolicy) -> Vec<RolledEpisode<f64>> {
    let mut count = 0;
    let episodes =
        rollout.run(policy, &SEEDS, |env| env.reward_terms()[0].value, |more| count += more).unwrap();
    assert_eq!(count, SEEDS.len() as u64);
    assert_eq!(episodes.iter().map(|episode| episode.seed).collect::<Vec<_>>(), SEEDS);
    episodes
}

#[test]
fn a_batch_of_episodes_is_those_episodes_whatever_its_size_and_threads() {
    for make in [recall_cue, tracking] {
        for algorithm in [Algorithm::LstmTd3, Algorithm::LstmSac] {
            let mut agent = agent(algorithm, make().as_ref());
            let alone: Vec<_> = SEEDS
                .map(|seed| run_episode(&mut agent, make().as_mut(), seed, &mut Compute::new(1)))
                .map(|episode| (episode.total_reward, episode.decisions))
                .into();
            for (rows, threads) in [(1, 1), (3, 1), (3, 2), (20, 2)] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut policy = AgentBatch::new(&agent, rows, Compute::new(threads));
                let together = pool.install(|| run(&mut copies(make, rows), &mut policy));
                let together: Vec<_> =
                    together.iter().map(|episode| (episode.total_reward, episode.decisions)).collect();
                assert_eq!(alone, together, "{rows} copies, {threads} threads");
            }
        }
    }
}

#[test]
fn random_actions_follow_from_the_seed_of_the_episode() {
    let one = run(&mut copies(tracking, 1), &mut UniformActions::new(1));
    let many = run(&mut copies(tracking, 4), &mut UniformActions::new(4));
    assert_eq!(one, many);
    assert_eq!(one[1], one[3], "equal seeds, equal episodes");
    assert_ne!(one[0].total_reward, one[1].total_reward);
    let still = run(&mut copies(tracking, 2), &mut NoAction);
    assert_ne!(one, still);
}

/// A policy whose weights have come to nothing.
struct NotANumber;

impl BatchPolicy for NotANumber {
    fn begin(&mut self, _row: usize, _seed: u64) {}

    fn act(&mut self, _observations: &[f32], actions: &mut [f32]) {
        actions.fill(f32::NAN);
    }
}

/// An environment that checks its actions, as those of this crate do.
#[test]
fn an_action_that_is_refused_is_told() {
    use searoom::env::open_water::{OpenWater, OpenWaterConfig};

    let env = OpenWater::new(OpenWaterConfig::default(), None).unwrap();
    let result = Rollout::new(vec![env]).run(&mut NotANumber, &[1], |_| (), |_| ());
    assert!(matches!(result, Err(ActionError::NotFinite { index: 0, .. })));
}
