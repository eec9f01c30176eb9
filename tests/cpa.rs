//! The refined CPA against a dense search of the same smoothed curve.

use nalgebra::Vector2;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::cpa::refined::{RefineConfig, Refiner};
use searoom::cpa::sampled::DistanceCurve;
use searoom::cpa::{CpaConfig, CpaMethod, Estimator, StraightMotion, linear};

const DT_S: f64 = 5.0;

/// The smoothed distance at any time, in steps from the first position, straight from its
/// definition.
fn smoothed_m(relative: &[Vector2<f64>], half_width: usize, time: f64) -> f64 {
    let last = relative.len() - 2;
    let at = |steps: f64| {
        let from = (steps.floor() as usize).min(last);
        relative[from].lerp(&relative[from + 1], steps - from as f64).norm()
    };
    let offsets = -(half_width as i64)..=half_width as i64;
    offsets.map(|k| at(time + k as f64)).sum::<f64>() / (2 * half_width + 1) as f64
}

/// The smallest smoothed distance by brute force: 12 points in every step, then a golden-section
/// search around every point that no neighbour undercuts and that is among the lowest.
fn dense_minimum_m(relative: &[Vector2<f64>], half_width: usize) -> f64 {
    const PER_STEP: usize = 12;
    let first = half_width as f64;
    let steps = relative.len() - 1 - 2 * half_width;
    let time = |point: usize| first + point as f64 / PER_STEP as f64;
    let values: Vec<f64> =
        (0..=steps * PER_STEP).map(|point| smoothed_m(relative, half_width, time(point))).collect();
    let lowest = values.iter().copied().fold(f64::INFINITY, f64::min);
    // No vessel here is faster than 60 m/s against the other.
    let reach_m = 60.0 * DT_S / PER_STEP as f64;
    let mut best = lowest;
    for point in (0..values.len()).filter(|&point| values[point] <= lowest + reach_m) {
        let (mut low, mut high) = (time(point.saturating_sub(1)), time((point + 1).min(values.len() - 1)));
        if values[point] > smoothed_m(relative, half_width, low).min(smoothed_m(relative, half_width, high)) {
            continue;
        }
        for _ in 0..60 {
            let third = 0.381_966 * (high - low);
            let (left, right) = (low + third, high - third);
            if smoothed_m(relative, half_width, left) < smoothed_m(relative, half_width, right) {
                high = right;
            } else {
                low = left;
            }
        }
        best = best.min(smoothed_m(relative, half_width, 0.5 * (low + high)));
    }
    best
}

fn vector(rng: &mut impl Rng, half_side: f64) -> Vector2<f64> {
    Vector2::new(rng.random_range(-half_side..half_side), rng.random_range(-half_side..half_side))
}

/// Relative positions of one encounter: straight, weaving, wandering, turning back (two dips), or
/// straight through own ship.
fn encounter(rng: &mut impl Rng, half_width: usize) -> Vec<Vector2<f64>> {
    let steps = 2 * half_width + 1 + rng.random_range(1..60);
    let meeting = rng.random_range(0.0..steps as f64);
    let velocity = vector(rng, 8.0);
    let miss_m = 10_f64.powf(rng.random_range(0.0..3.5));
    let miss = vector(rng, miss_m);
    let kind = rng.random_range(0..5);
    let amplitude_s = rng.random_range(5.0..60.0);
    let period = rng.random_range(10.0..40.0);
    let noise_m = rng.random_range(0.1..15.0);
    let mut wander = Vector2::zeros();
    (0..steps)
        .map(|step| {
            let along = step as f64 - meeting;
            let line = miss + velocity * (along * DT_S);
            let across = Vector2::new(velocity.y, -velocity.x);
            let wave = (std::f64::consts::TAU * along / period).sin();
            match kind {
                0 => line,
                1 => line + across * (amplitude_s * wave),
                2 => {
                    wander = wander * 0.9 + vector(rng, noise_m);
                    line + wander
                }
                // Forth and back: the same distance comes near twice.
                3 => miss + velocity * (DT_S * 0.25 * period * wave) + across * (0.4 * along),
                _ => velocity * (along * DT_S),
            }
        })
        .collect()
}

#[test]
fn ten_thousand_encounters_meet_a_dense_search() {
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let mut refiner = Refiner::new(RefineConfig::default());
    let (mut solves, mut two_dips, mut better) = (0, 0, 0);
    for case in 0..10_000 {
        let relative = encounter(&mut rng, 10);
        let mut curve = DistanceCurve::new(10);
        curve.fill_relative(relative.iter().copied(), rng.random_range(0..relative.len()), DT_S);
        let refined = refiner.closest(&curve);
        let dense_m = dense_minimum_m(&relative, 10);
        assert!(
            refined.cpa.distance_m <= dense_m + 1e-6 * dense_m + 1e-3,
            "case {case}: {refined:?} lies above {dense_m}"
        );
        let step = refined.cpa.time_s / DT_S - curve.time_s(0) / DT_S;
        let attained_m = smoothed_m(&relative, 10, step);
        assert!(
            (refined.cpa.distance_m - attained_m).abs() < 1e-6,
            "case {case}: {refined:?} is not the distance at its time, {attained_m}"
        );
        assert!(refined.cpa.distance_m <= curve.closest().distance_m);
        assert_eq!(refined.fallbacks, 0, "case {case}: the solver failed");
        solves += refined.solves;
        better += usize::from(refined.cpa.distance_m < curve.closest().distance_m - 1e-3);
        let dips = curve.smoothed_m().windows(3).filter(|w| w[1] < w[0] && w[1] < w[2]).count();
        two_dips += usize::from(dips >= 2);
    }
    // The cases are worth their name: the solver works, it improves, and curves have several dips.
    assert!(solves > 7_000 && better > 5_000 && two_dips > 1_000, "{solves} {better} {two_dips}");
}

#[test]
fn without_smoothing_it_is_the_exact_cpa_of_two_polylines() {
    let mut rng = ChaCha8Rng::seed_from_u64(32);
    let mut refiner = Refiner::new(RefineConfig::default());
    for case in 0..5_000 {
        let relative = encounter(&mut rng, 0);
        let mut curve = DistanceCurve::new(0);
        curve.fill_relative(relative.iter().copied(), 0, DT_S);
        let refined = refiner.closest(&curve);
        // Each step by the closed form for straight motions, held to the step.
        let exact_m = relative
            .windows(2)
            .map(|pair| {
                let velocity = (pair[1] - pair[0]) / DT_S;
                let zero = Vector2::zeros();
                let time_s = linear::closest_approach(zero, zero, pair[0], velocity).time_s.clamp(0.0, DT_S);
                (pair[0] + velocity * time_s).norm()
            })
            .fold(f64::INFINITY, f64::min);
        assert!((refined.cpa.distance_m - exact_m).abs() < 1e-6, "case {case}: {refined:?}, {exact_m}");
        assert_eq!((refined.solves, refined.fallbacks), (0, 0));
    }
}

#[test]
fn what_was_solved_before_leaves_no_trace() {
    let mut rng = ChaCha8Rng::seed_from_u64(33);
    let mut used = Refiner::new(RefineConfig::default());
    for _ in 0..200 {
        let mut curve = DistanceCurve::new(10);
        curve.fill_relative(encounter(&mut rng, 10), 10, DT_S);
        let fresh = Refiner::new(RefineConfig::default()).closest(&curve);
        assert_eq!(used.closest(&curve), fresh);
    }
}

#[test]
fn the_estimator_serves_targets_of_different_lengths_by_either_method() {
    let mut rng = ChaCha8Rng::seed_from_u64(34);
    let own = StraightMotion { position: Vector2::new(100.0, -40.0), velocity: Vector2::new(3.0, 1.0) };
    let mut refined = Estimator::new(&CpaConfig::default());
    let mut sampled = Estimator::new(&CpaConfig { method: CpaMethod::Sampled, ..CpaConfig::default() });
    for _ in 0..50 {
        let target = encounter(&mut rng, 10);
        let by_refined = refined.estimate(own, target.iter().copied(), 12, DT_S);
        let by_sampled = sampled.estimate(own, target.iter().copied(), 12, DT_S);
        assert!(by_refined.cpa.distance_m <= by_sampled.cpa.distance_m);
        let relative: Vec<_> = target
            .iter()
            .enumerate()
            .map(|(step, p)| p - own.position - own.velocity * (DT_S * (step as f64 - 12.0)))
            .collect();
        let dense_m = dense_minimum_m(&relative, 10);
        assert!((by_refined.cpa.distance_m - dense_m).abs() <= 1e-6 * dense_m + 1e-3);
    }
}
