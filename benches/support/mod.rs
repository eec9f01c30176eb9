//! What the benches of the networks share: a clock and the machine's own measure.

#![allow(dead_code)]

use std::sync::Arc;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::nn::{Activation, Compute, Dense, Layout, Parameters};
use searoom::rl::replay::Batch;

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

/// What this machine reaches in f32 matrix products, in 1e9 floating-point operations per second: 128 rows through a
/// dense layer of 512 x 512 whose weights stay in the second-level cache. On large matrices libraries do no better.
pub fn machine_gflops(threads: usize) -> f64 {
    const ROWS: usize = 128;
    let mut layout = Layout::new();
    let layer = Dense::new(&mut layout, "linear", 512, 512, Activation::Identity);
    let layout = Arc::new(layout);
    let parameters = Parameters::<f32>::initialised(&layout, &mut ChaCha8Rng::seed_from_u64(1));
    let input = vec![0.5f32; ROWS * layer.inputs()];
    let mut output = vec![0.0f32; ROWS * layer.outputs()];
    let mut compute = Compute::new(threads);
    let seconds = median_seconds(0.5, || layer.forward(&mut compute, &parameters, &input, ROWS, &mut output));
    2.0 * layer.operations(ROWS) as f64 / seconds / 1e9
}

/// A batch filled with random numbers and full histories, as nearly all of a long episode are.
pub fn random_batch(mut batch: Batch, rng: &mut ChaCha8Rng) -> Batch {
    for numbers in [
        &mut batch.observation,
        &mut batch.action,
        &mut batch.reward,
        &mut batch.next_observation,
        &mut batch.history,
        &mut batch.next_history,
    ] {
        numbers.fill_with(|| rng.random_range(-1.0..1.0));
    }
    batch.continues.fill(1.0);
    batch.history_lengths.fill(batch.history_len);
    batch.next_history_lengths.fill(batch.history_len);
    batch
}

/// What stands on a bench's command line: words, and numbers behind `--name`.
pub struct Arguments {
    words: Vec<String>,
    numbers: Vec<(String, usize)>,
}

impl Arguments {
    /// Reads the command line; Cargo's own `--bench` is left out.
    pub fn parse() -> Self {
        let mut parsed = Self { words: Vec::new(), numbers: Vec::new() };
        let mut arguments = std::env::args().skip(1).filter(|word| word != "--bench");
        while let Some(word) = arguments.next() {
            match word.strip_prefix("--") {
                Some(name) => {
                    let number = arguments.next().and_then(|n| n.parse().ok());
                    parsed.numbers.push((name.to_owned(), number.expect("a number follows each option")));
                }
                None => parsed.words.push(word),
            }
        }
        parsed
    }

    /// Whether a subject was named, or none at all.
    pub fn wants(&self, subject: &str) -> bool {
        self.words.is_empty() || self.words.iter().any(|word| word == subject)
    }

    /// The number behind `--name`.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.numbers.iter().rev().find(|(given, _)| given == name).map(|(_, number)| *number)
    }

    /// The number behind `--threads`, 1 without.
    pub fn threads(&self) -> usize {
        self.number("threads").unwrap_or(1)
    }
}
