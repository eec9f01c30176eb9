//! Steps of the environments on one core, with and without estimates of the collision risk, beside what an update of
//! the agent costs.
//!
//! `cargo bench --bench env_steps -- [open-water|coastal]` prints one JSON line per subject. Actions are random; a step's
//! time is that of whole episodes, resets included, over their decisions.

mod support;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::ais::{self, Area, ImportConfig};
use searoom::env::coastal::{Coastal, CoastalConfig, RecordedTraffic};
use searoom::env::open_water::{OpenWater, OpenWaterConfig};
use searoom::env::{Env, SeedDomain};
use searoom::forecast::{Forecaster, LstmForecaster, Model, SplitConfig, split_by_time};
use searoom::nn::Compute;
use searoom::nn::weights::WeightsFile;
use searoom::rl::agent::{Agent, AgentConfig, Algorithm};
use searoom::rl::replay::{Batch, ReplayShape};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = support::Arguments::parse();
    if arguments.wants("open-water") {
        let env = |forecaster| OpenWater::new(OpenWaterConfig::default(), forecaster);
        let mut with = env(Some(forecaster("open-water-stochastic")?))?;
        report("env-open-water", &mut with, &mut env(None)?, 40);
    }
    if arguments.wants("coastal") {
        let area = Area::load(&root("ais/ny-lower-bay.toml"))?;
        let file = root("ais/ny-harbor-2020-12.csv.gz");
        let import = ais::import(&[file], &area, &ImportConfig::default(), None, &|_| {})?;
        let tracks = split_by_time(&import.tracks, &SplitConfig::default())?.train;
        let config = CoastalConfig::default();
        let traffic = Arc::new(RecordedTraffic::new(tracks, &config)?);
        let env = |forecaster| Coastal::new(config.clone(), Arc::clone(&traffic), forecaster);
        let mut with = env(Some(forecaster("coastal-ny-lower-bay")?))?;
        report("env-coastal", &mut with, &mut env(None)?, 400);
    }
    Ok(())
}

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn forecaster(name: &str) -> Result<Box<dyn Forecaster>, Box<dyn std::error::Error>> {
    let file = WeightsFile::open(&root(&format!("models/{name}.safetensors")))?;
    Ok(Box::new(LstmForecaster::new(Model::from_file(file)?, 1)))
}

fn report(subject: &str, with: &mut dyn Env, without: &mut dyn Env, episodes: u64) {
    let plain = step_seconds(without, episodes);
    let seconds = step_seconds(with, episodes);
    // Forecasts that were kept serve the second time, as they do in a long training.
    let again = step_seconds(with, episodes);
    let updates = [Algorithm::LstmTd3, Algorithm::LstmSac].map(|algorithm| update_seconds(algorithm, with));
    let line = serde_json::json!({
        "subject": subject,
        "who": "searoom",
        "threads": 1,
        "seconds": seconds,
        "steps_per_s": 1.0 / seconds,
        "steps_per_s_same_episodes_again": 1.0 / again,
        "steps_per_s_without_estimates": 1.0 / plain,
        "td3_update_seconds": updates[0],
        "sac_update_seconds": updates[1],
        "share_of_td3_update": seconds / updates[0],
        "share_of_sac_update": seconds / updates[1],
    });
    println!("{line}");
}

/// Mean seconds of a decision over training episodes.
fn step_seconds(env: &mut dyn Env, episodes: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut observation = vec![0.0; env.observation_len()];
    let mut decisions = 0;
    let start = Instant::now();
    for episode in 0..episodes {
        env.reset(SeedDomain::Training.seed(episode), &mut observation);
        loop {
            let step = env.step(&[rng.random_range(-1.0..1.0)], &mut observation).expect("a valid action");
            decisions += 1;
            if step.ends_episode() {
                break;
            }
        }
    }
    start.elapsed().as_secs_f64() / decisions as f64
}

/// Median seconds of an update on observations of this environment: two at a time, since every second one of LSTM-TD3
/// leaves the actor out.
fn update_seconds(algorithm: Algorithm, env: &dyn Env) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let config = AgentConfig { algorithm, ..AgentConfig::default() };
    let (rows, steps) = (config.batch_size, config.history_len);
    let (observation_len, action_len) = (env.observation_len(), env.action_len());
    let mut agent = Agent::new(config, observation_len, action_len, &mut rng);
    let shape = ReplayShape { observation_len, action_len, capacity: 2 };
    let batch = support::random_batch(Batch::new(&shape, rows, steps), &mut rng);
    let (mut compute, mut scalars) = (Compute::new(1), Vec::new());
    let two = support::median_seconds(1.0, || {
        for _ in 0..2 {
            agent.update(&mut compute, &batch, &mut rng, &mut scalars);
        }
    });
    two / 2.0
}
