//! The forecast of open water as the agent asks for it: ten obstacles, 100 steps forwards and backwards.
//!
//! `cargo bench --bench forecast_rollout -- [--threads N]` prints one JSON line. Rivals:
//! `rivals/forecast_rollout_torch.py` and `rivals/forecast_rollout_jax.py`, with the same weights; all three
//! print where the first obstacle ends up.

mod support;

use std::path::Path;

use searoom::forecast::{Forecaster, Forecasts, LstmForecaster, Model};
use searoom::geo::Position;
use searoom::nn::weights::WeightsFile;

const MODEL: &str = "models/open-water-stochastic.safetensors";
const OBSTACLES: usize = 10;
const HISTORY: usize = 10;
const STEPS: usize = 100;

fn main() {
    let threads = support::Arguments::parse().threads();
    let file =
        WeightsFile::open(&Path::new(env!("CARGO_MANIFEST_DIR")).join(MODEL)).expect("the shipped model");
    let mut forecaster = LstmForecaster::new(Model::from_file(file).expect("a forecaster"), threads);
    let histories: Vec<Vec<Position>> = (0..OBSTACLES).map(history).collect();
    let histories: Vec<&[Position]> = histories.iter().map(Vec::as_slice).collect();
    let mut forecasts = Forecasts::new();
    let seconds = support::median_seconds(2.0, || {
        forecaster.forecast_both_ways(&histories, STEPS, &mut forecasts).expect("complete histories");
    });
    let end = |path: usize| forecasts.path(path)[STEPS - 1];
    let line = serde_json::json!({
        "subject": "forecast-rollout",
        "who": "searoom",
        "threads": threads,
        "seconds": seconds,
        "ends_m": [end(0).north_m, end(0).east_m, end(OBSTACLES).north_m, end(OBSTACLES).east_m],
    });
    println!("{line}");
}

/// A gentle arc, another one for each obstacle; the rivals compute the same.
fn history(obstacle: usize) -> Vec<Position> {
    let speed_m = 5.0 + 2.0 * obstacle as f64;
    (0..HISTORY)
        .map(|k| {
            let angle = 0.05 * k as f64 + 0.3 * obstacle as f64;
            Position { north_m: speed_m * k as f64 * angle.cos(), east_m: speed_m * k as f64 * angle.sin() }
        })
        .collect()
}
