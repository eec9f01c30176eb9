//! What the benches of the networks share: a clock and the machine's own measure.

#![allow(dead_code)]

use std::sync::Arc;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use searoom::nn::{Activation, Compute, Dense, Layout, Parameters};

/// Median seconds of one call of `work`, over about `seconds` of calls after a warm-up.
pub fn median_seconds(seconds: f64, mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    while start.elapsed().as_secs_f64() < seconds / 4.0 {
        work();
    }
    let mut times = Vec::new();
    let start = Instant::now();
    while times.len() < 5 || start.elapsed().as_secs_f64() < seconds {
        let call = Instant::now();
        work();
        times.push(call.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// What this machine reaches in f32 matrix products, in 1e9 floating-point operations per second: 512 rows
/// through a dense layer of 1024 x 1024, the fastest product we know for it.
pub fn machine_gflops(threads: usize) -> f64 {
    const ROWS: usize = 512;
    const UNITS: usize = 1024;
    let mut layout = Layout::new();
    let layer = Dense::new(&mut layout, "linear", UNITS, UNITS, Activation::Identity);
    let layout = Arc::new(layout);
    let parameters = Parameters::<f32>::initialised(&layout, &mut ChaCha8Rng::seed_from_u64(1));
    let input = vec![0.5f32; ROWS * UNITS];
    let mut output = vec![0.0f32; ROWS * UNITS];
    let mut compute = Compute::new(threads);
    let seconds = median_seconds(0.5, || layer.forward(&mut compute, &parameters, &input, ROWS, &mut output));
    2.0 * layer.operations(ROWS) as f64 / seconds / 1e9
}

/// The number after `--threads`, 1 without; other words are returned in order.
pub fn arguments() -> (usize, Vec<String>) {
    let mut threads = 1;
    let mut words = Vec::new();
    let mut arguments = std::env::args().skip(1).filter(|word| word != "--bench");
    while let Some(word) = arguments.next() {
        if word == "--threads" {
            threads = arguments.next().and_then(|n| n.parse().ok()).expect("--threads takes a number");
        } else {
            words.push(word);
        }
    }
    (threads, words)
}
