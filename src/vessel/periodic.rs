//! The periodic motion: a sinusoidal weave across a straight line, with noise.
//!
//! Paper, section "Problem description":
//! `q_k = (v_y, -v_x) A_sin sin(2 pi k / period + phase) + w_k`, `w_k ~ N2(0, sigma^2 I)`. The period
//! is 20 time steps (the paper's table prints seconds, which would leave four samples per period);
//! the phase is uniform on `[0, 2 pi)`.

use std::f64::consts::TAU;

use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{Linear, OffsetProcess, Span, Wandering};
use crate::config::BoundedNumber;
use crate::config::bounds::{POSITIVE, SIZE};

/// Constants of the periodic motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PeriodicConfig {
    /// Amplitude `A_sin` per speed, in seconds: the weave is `A_sin |v|` metres to either side.
    pub amplitude_s: f64,
    /// Time steps in one period.
    pub period_steps: f64,
    /// Standard deviation of the noise on either axis, in metres.
    pub noise_sd_m: f64,
    /// Steps that the process runs before its vessel appears.
    pub burn_in_steps: usize,
}

impl PeriodicConfig {
    /// Its numbers and what they can be.
    pub(crate) fn numbers(&self) -> Vec<BoundedNumber> {
        vec![
            ("amplitude_s", self.amplitude_s, SIZE),
            ("period_steps", self.period_steps, POSITIVE),
            ("noise_sd_m", self.noise_sd_m, SIZE),
            ("burn_in_steps", self.burn_in_steps as f64, SIZE),
        ]
    }
}

impl Default for PeriodicConfig {
    fn default() -> Self {
        Self { amplitude_s: 15.0, period_steps: 20.0, noise_sd_m: 4.0, burn_in_steps: 60 }
    }
}

/// The offsets `q_k` of one vessel.
#[derive(Debug, Clone, PartialEq)]
pub struct Process {
    config: PeriodicConfig,
    /// The weave's amplitude as a vector to starboard of the velocity, in metres.
    across_m: Vector2<f64>,
    phase_rad: f64,
    step: u64,
}

impl Process {
    /// The process of a vessel with this velocity, in metres per second, at a random phase.
    #[must_use]
    pub fn new(config: PeriodicConfig, velocity_mps: Vector2<f64>, rng: &mut impl Rng) -> Self {
        Self::with_phase(config, velocity_mps, rng.random_range(0.0..TAU))
    }

    /// The process with a phase that is given, in radians.
    #[must_use]
    pub fn with_phase(config: PeriodicConfig, velocity_mps: Vector2<f64>, phase_rad: f64) -> Self {
        let across_m = Vector2::new(velocity_mps.y, -velocity_mps.x) * config.amplitude_s;
        Self { config, across_m, phase_rad, step: 0 }
    }
}

impl OffsetProcess for Process {
    fn next_offset(&mut self, rng: &mut impl Rng) -> Vector2<f64> {
        let angle = TAU * (self.step as f64 / self.config.period_steps) + self.phase_rad;
        self.step += 1;
        let noise = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        self.across_m * angle.sin() + noise * self.config.noise_sd_m
    }
}

/// A vessel that weaves periodically about `linear`, drawn for a number of steps before and after
/// step 0.
#[must_use]
pub fn motion(
    config: PeriodicConfig,
    linear: Linear,
    history_steps: usize,
    future_steps: usize,
    rng: &mut impl Rng,
) -> Wandering {
    let span = Span { history_steps, future_steps, burn_in_steps: config.burn_in_steps };
    Wandering::new(linear, Process::new(config, linear.velocity().xy(), rng), span, rng)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn moments_are_those_of_the_closed_form() {
        let config = PeriodicConfig::default();
        let velocity = Vector2::new(3.0, 4.0);
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut process = Process::new(config, velocity, &mut rng);
        let offsets: Vec<_> = (0..100_000).map(|_| process.next_offset(&mut rng)).collect();
        let along = velocity.normalize();
        let starboard = Vector2::new(along.y, -along.x);
        let variance = |axis: Vector2<f64>| {
            offsets.iter().map(|q| q.dot(&axis).powi(2)).sum::<f64>() / offsets.len() as f64
        };
        let noise = config.noise_sd_m.powi(2);
        let weave = (velocity.norm() * config.amplitude_s).powi(2) / 2.0;
        assert!((variance(along) / noise - 1.0).abs() < 0.03, "{}", variance(along));
        assert!((variance(starboard) / (noise + weave) - 1.0).abs() < 0.01, "{}", variance(starboard));
    }

    #[test]
    fn without_noise_it_repeats_after_twenty_steps() {
        let config = PeriodicConfig { noise_sd_m: 0.0, ..PeriodicConfig::default() };
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut process = Process::with_phase(config, Vector2::new(2.0, 0.0), 0.0);
        let offsets: Vec<_> = (0..60).map(|_| process.next_offset(&mut rng)).collect();
        assert_eq!(offsets[0], Vector2::zeros());
        // A quarter of a period on, it is all the way over to starboard.
        assert!((offsets[5] - Vector2::new(0.0, -30.0)).norm() < 1e-9);
        for k in 0..40 {
            assert!((offsets[k] - offsets[k + 20]).norm() < 1e-9);
        }
    }
}
