//! The stochastic motion: a smoothed first-order autoregressive wander about a straight line.
//!
//! Paper, section "Problem description": `A_0 = 0`, `A_{k+1} = phi A_k + u_k` with
//! `u_k ~ N2(0, sigma^2 I)`; smoothed `S_0 = 0`, `S_k = beta A_k + (1 - beta) S_{k-1}`; the offset is
//! `q_k = (|v| / v_max) S_k`.

use nalgebra::Vector2;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{Linear, OffsetProcess, Span, Wandering};
use crate::config::BoundedNumber;
use crate::config::bounds::{FRACTION, POSITIVE, SIZE};

/// Constants of the stochastic motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StochasticConfig {
    /// Autoregression `phi` per time step, in `[0, 1)`.
    pub phi: f64,
    /// Standard deviation of the innovations on either axis, in metres.
    pub innovation_sd_m: f64,
    /// Weight `beta` of the newest value in the exponential smoothing, in `(0, 1]`.
    pub beta: f64,
    /// The speed at which offsets are unscaled, in metres per second.
    pub v_max_mps: f64,
    /// Steps that the process runs before its vessel appears.
    pub burn_in_steps: usize,
}

impl StochasticConfig {
    /// Its numbers and what they can be.
    pub(crate) fn numbers(&self) -> Vec<BoundedNumber> {
        vec![
            ("phi", self.phi, FRACTION),
            ("innovation_sd_m", self.innovation_sd_m, SIZE),
            ("beta", self.beta, FRACTION),
            ("v_max_mps", self.v_max_mps, POSITIVE),
            ("burn_in_steps", self.burn_in_steps as f64, SIZE),
        ]
    }
}

impl Default for StochasticConfig {
    fn default() -> Self {
        Self { phi: 0.9, innovation_sd_m: 15.0, beta: 0.2, v_max_mps: 5.0, burn_in_steps: 60 }
    }
}

/// The offsets `q_k` of one vessel.
#[derive(Debug, Clone, PartialEq)]
pub struct Process {
    config: StochasticConfig,
    scale: f64,
    wander: Vector2<f64>,
    smoothed: Option<Vector2<f64>>,
}

impl Process {
    /// The process of a vessel with this velocity, in metres per second.
    #[must_use]
    pub fn new(config: StochasticConfig, velocity_mps: Vector2<f64>) -> Self {
        let scale = velocity_mps.norm() / config.v_max_mps;
        Self { config, scale, wander: Vector2::zeros(), smoothed: None }
    }
}

impl OffsetProcess for Process {
    fn next_offset(&mut self, rng: &mut impl Rng) -> Vector2<f64> {
        let Some(last) = self.smoothed else {
            self.smoothed = Some(Vector2::zeros());
            return Vector2::zeros();
        };
        let StochasticConfig { phi, innovation_sd_m, beta, .. } = self.config;
        let innovation = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        self.wander = self.wander * phi + innovation * innovation_sd_m;
        let smoothed = self.wander * beta + last * (1.0 - beta);
        self.smoothed = Some(smoothed);
        smoothed * self.scale
    }
}

/// A vessel that wanders stochastically about `linear`, drawn for a number of steps before and
/// after step 0.
#[must_use]
pub fn motion(
    config: StochasticConfig,
    linear: Linear,
    history_steps: usize,
    future_steps: usize,
    rng: &mut impl Rng,
) -> Wandering {
    let span = Span { history_steps, future_steps, burn_in_steps: config.burn_in_steps };
    Wandering::new(linear, Process::new(config, linear.velocity().xy()), span, rng)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Mean of the products `q_k q_{k+lag}` over both axes of a long run.
    fn autocovariance(offsets: &[Vector2<f64>], lag: usize) -> f64 {
        let pairs = offsets.iter().zip(&offsets[lag..]);
        pairs.map(|(now, later)| now.dot(later) / 2.0).sum::<f64>() / (offsets.len() - lag) as f64
    }

    /// The smoothed process is an AR(2) with roots `phi` and `gamma = 1 - beta`, whose moments are
    /// known in closed form.
    #[test]
    fn moments_are_those_of_the_closed_form() {
        let config = StochasticConfig::default();
        let velocity = Vector2::new(-4.2, 5.6);
        let mut process = Process::new(config, velocity);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let offsets: Vec<_> = (0..400_000).map(|_| process.next_offset(&mut rng)).collect();

        let (phi, gamma) = (config.phi, 1.0 - config.beta);
        let innovation_sd = config.beta * config.innovation_sd_m * velocity.norm() / config.v_max_mps;
        let variance = innovation_sd.powi(2) * (1.0 + phi * gamma)
            / ((1.0 - phi * phi) * (1.0 - gamma * gamma) * (1.0 - phi * gamma));
        let lag_one = (phi + gamma) / (1.0 + phi * gamma);
        let lag_two = (phi + gamma) * lag_one - phi * gamma;
        for (lag, expected) in [(0, 1.0), (1, lag_one), (2, lag_two)] {
            let measured = autocovariance(&offsets, lag) / variance;
            assert!((measured - expected).abs() < 0.02, "lag {lag}: {measured} against {expected}");
        }
        let mean = offsets.iter().sum::<Vector2<f64>>() / offsets.len() as f64;
        assert!(mean.norm() < 0.02 * variance.sqrt(), "{mean}");
        let across = offsets.iter().map(|q| q.x * q.y).sum::<f64>() / offsets.len() as f64;
        assert!(across.abs() < 0.02 * variance, "{across}");
    }

    /// After the burn-in the spread of an ensemble is that of the stationary process.
    #[test]
    fn a_vessel_appears_with_a_stationary_offset() {
        let config = StochasticConfig::default();
        let (phi, gamma) = (config.phi, 1.0 - config.beta);
        let variance = (config.beta * config.innovation_sd_m).powi(2) * (1.0 + phi * gamma)
            / ((1.0 - phi * phi) * (1.0 - gamma * gamma) * (1.0 - phi * gamma));
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let count = 4000;
        let mean_square = (0..count)
            .map(|_| {
                let mut process = Process::new(config, Vector2::new(5.0, 0.0));
                let at_start = (0..=config.burn_in_steps).map(|_| process.next_offset(&mut rng)).last();
                at_start.unwrap_or_default().norm_squared() / 2.0
            })
            .sum::<f64>()
            / f64::from(count);
        assert!((mean_square / variance - 1.0).abs() < 0.06, "{mean_square} against {variance}");
    }

    #[test]
    fn the_process_starts_at_zero_and_follows_its_recursion() {
        let config = StochasticConfig::default();
        let mut process = Process::new(config, Vector2::new(0.0, 10.0));
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut same = rng.clone();
        assert_eq!(process.next_offset(&mut rng), Vector2::zeros());
        let first = process.next_offset(&mut rng);
        let innovation = Vector2::from_fn(|_, _| same.sample::<f64, _>(StandardNormal) * 15.0);
        assert!((first - innovation * 0.2 * 2.0).norm() < 1e-12);
    }
}
