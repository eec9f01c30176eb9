//! The refined CPA with 21 terms: one cone programme on reused structures, the same set up anew each
//! time (the rival), and whole estimates as an environment asks for them.
//!
//! `cargo bench --bench cpa_refine`

use std::time::Instant;

use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::cpa::refined::{RefineConfig, Refiner};
use searoom::cpa::sampled::DistanceCurve;
use searoom::cpa::{CpaConfig, CpaMethod, Estimator, StraightMotion};

const HALF_WIDTH: usize = 10;
const DT_S: f64 = 5.0;
/// The most that one segment should take.
const BUDGET_US: f64 = 250.0;

/// Ten observed positions, 100 forecast and 100 backcast ones of a weaving target ship that passes near
/// own ship.
fn target(rng: &mut ChaCha8Rng, steps: usize) -> Vec<Vector2<f64>> {
    let mut draw = |half: f64| rng.random_range(-half..half);
    let (velocity, miss) = (Vector2::new(draw(5.0), draw(5.0)), Vector2::new(draw(400.0), draw(400.0)));
    let (phase, meeting) = (draw(3.1), steps as f64 / 2.0 + draw(steps as f64 / 4.0));
    let across = Vector2::new(velocity.y, -velocity.x);
    (0..steps)
        .map(|step| {
            let wave = (0.314 * step as f64 + phase).sin();
            miss + velocity * (DT_S * (step as f64 - meeting)) + across * (15.0 * wave)
        })
        .collect()
}

/// Microseconds per call.
fn time_us(calls: usize, mut run: impl FnMut()) -> f64 {
    let start = Instant::now();
    run();
    start.elapsed().as_secs_f64() * 1e6 / calls as f64
}

fn main() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let targets: Vec<_> = (0..2000).map(|_| target(&mut rng, 210)).collect();
    let still = StraightMotion { position: Vector2::zeros(), velocity: Vector2::zeros() };

    // The step around the sampled minimum, alone: at most two steps with 21 terms each.
    let curves: Vec<_> = targets
        .iter()
        .map(|target| {
            let mut curve = DistanceCurve::new(HALF_WIDTH);
            curve.fill(still, target.iter().copied(), 109, DT_S);
            curve
        })
        .collect();
    let mut refiner = Refiner::new(RefineConfig::default());
    let solves: usize = curves.iter().map(|curve| refiner.closest(curve).solves).sum();
    let fallbacks: usize = curves.iter().map(|curve| refiner.closest(curve).fallbacks).sum();
    let reused_us = time_us(solves, || {
        for curve in &curves {
            std::hint::black_box(refiner.closest(curve));
        }
    });
    let anew_us = time_us(solves, || {
        for curve in &curves {
            std::hint::black_box(Refiner::new(RefineConfig::default()).closest(curve));
        }
    });
    println!(
        "cpa-refine: {} forecasts, {solves} cone programmes of 21 terms, {fallbacks} fallbacks",
        targets.len()
    );
    println!(
        "cpa-refine segment: {reused_us:.1} us reused, {anew_us:.1} us set up anew (budget {BUDGET_US} us)"
    );

    for (name, method, smoothing) in [
        ("refined, n = 10", CpaMethod::Refined, HALF_WIDTH),
        ("sampled, n = 10", CpaMethod::Sampled, HALF_WIDTH),
        ("refined, n = 0", CpaMethod::Refined, 0),
    ] {
        let mut estimator = Estimator::new(&CpaConfig { method, smoothing, ..CpaConfig::default() });
        let mut run = || {
            for target in &targets {
                std::hint::black_box(estimator.estimate(still, target.iter().copied(), 109, DT_S));
            }
        };
        run();
        println!("cpa-estimate ({name}, 210 positions): {:.1} us", time_us(targets.len(), run));
    }
    println!(
        "cpa-refine cores 1 ratio {:.2} (ours {reused_us:.1} us, best rival {anew_us:.1} us set-up-anew)",
        anew_us / reused_us
    );
}
