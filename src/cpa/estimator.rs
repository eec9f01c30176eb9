//! Forecast-based CPAs for many target ships, one after the other, on the same buffers.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::refined::{RefineConfig, RefinedCpa, Refiner};
use super::sampled::DistanceCurve;

/// How a forecast-based CPA is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CpaMethod {
    /// The minimum over all times.
    #[default]
    Refined,
    /// The minimum over the time steps.
    Sampled,
}

/// Settings of forecast-based CPAs. The defaults are those of open water; coastal waters have
/// `smoothing = 0`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CpaConfig {
    /// Minimum over all times or over the time steps.
    pub method: CpaMethod,
    /// Distances are averaged over this many steps either side (the paper's `n`).
    pub smoothing: usize,
    /// Tolerances of the minimum over all times.
    pub refine: RefineConfig,
}

impl Default for CpaConfig {
    fn default() -> Self {
        Self { method: CpaMethod::Refined, smoothing: 10, refine: RefineConfig::default() }
    }
}

/// Own ship as a forecast-based CPA sees it: on its present velocity, forwards and backwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StraightMotion {
    /// Position now, in metres.
    pub position: Vector2<f64>,
    /// Velocity over ground, in metres per second.
    pub velocity: Vector2<f64>,
}

/// Finds CPAs with forecast motions. Its buffers grow to the longest forecast seen and stay.
#[derive(Debug, Clone)]
pub struct Estimator {
    method: CpaMethod,
    curve: DistanceCurve,
    refiner: Refiner,
}

impl Estimator {
    /// An estimator with empty buffers.
    #[must_use]
    pub fn new(config: &CpaConfig) -> Self {
        Self {
            method: config.method,
            curve: DistanceCurve::new(config.smoothing),
            refiner: Refiner::new(config.refine),
        }
    }

    /// The CPA of own ship with a target ship whose positions, `dt_s` apart, are the backcast, what
    /// was observed and the forecast in one row; position number `now` is the present one.
    pub fn estimate(
        &mut self,
        own: StraightMotion,
        target: impl IntoIterator<Item = Vector2<f64>>,
        now: usize,
        dt_s: f64,
    ) -> RefinedCpa {
        self.curve.fill(own, target, now, dt_s);
        match self.method {
            CpaMethod::Refined => self.refiner.closest(&self.curve),
            CpaMethod::Sampled => RefinedCpa { cpa: self.curve.closest(), solves: 0, fallbacks: 0 },
        }
    }

    /// The distances behind the last estimate.
    #[must_use]
    pub fn curve(&self) -> &DistanceCurve {
        &self.curve
    }
}
