//! One training iteration of a forecaster: forward pass, gradients, Adam, on a batch of 32.
//!
//! `cargo bench --bench forecast_train -- [open|coastal] [--threads N]` prints one JSON line per subject. Rivals:
//! `rivals/forecast_train_torch.py` and `rivals/forecast_train_jax.py`.

mod support;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::forecast::network::{Batch, ForecastNetwork, NetworkConfig};
use searoom::nn::{Adam, AdamConfig, Compute, Gradients};

const ROWS: usize = 32;
const LEARNING_RATE: f64 = 1e-4;

fn main() {
    let arguments = support::Arguments::parse();
    for (name, config) in [("open", NetworkConfig::open_water()), ("coastal", NetworkConfig::coastal())] {
        if arguments.wants(name) {
            measure(name, config, arguments.threads());
        }
    }
}

fn measure(name: &str, config: NetworkConfig, threads: usize) {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut random = |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random_range(-1.0..1.0)).collect() };
    let (histories, anchors) = (random(config.steps * ROWS * 2), random(ROWS * 2));
    let targets = random(ROWS * config.outputs());
    let batch = Batch { histories: &histories, anchors: &anchors, rows: ROWS };

    let mut network = ForecastNetwork::<f32>::new(config, &mut ChaCha8Rng::seed_from_u64(2));
    let mut compute = Compute::new(threads);
    let mut state = network.state(ROWS);
    let layout = std::sync::Arc::clone(network.parameters.layout());
    let mut gradients = Gradients::zeros(&layout);
    let mut adam = Adam::new(&layout, AdamConfig::default());
    let mut loss = 0.0;
    let seconds = support::median_seconds(2.0, || {
        gradients.clear();
        loss = network.accumulate_gradients(&mut compute, batch, &targets, &mut state, &mut gradients);
        adam.step(&mut compute, &mut network.parameters, &gradients, LEARNING_RATE);
    });
    assert!(loss.is_finite() && loss < 1.0, "the network learned the batch: loss {loss}");

    // Backward takes two products for every one of the forward pass; an operation is a multiply or an add.
    let gflops = 6.0 * network.operations(ROWS) as f64 / seconds / 1e9;
    let machine = support::machine_gflops(threads);
    let line = serde_json::json!({
        "subject": format!("forecast-train-{name}"),
        "who": "searoom",
        "threads": threads,
        "seconds": seconds,
        "gflops": gflops,
        "machine_gflops": machine,
        "share": gflops / machine,
    });
    println!("{line}");
}
