//! The best linear predictor of a known process: the mark for a network on open water.
//!
//! A position is `p_k = p_0 + v t_k + q_k`, with `p_0` unknown, the components of `v` independent and
//! uniform, and `q` of known covariance and uncorrelated with `v`. Then the positions relative to the
//! last one have, on either axis, the covariance
//! `C(i, j) = var(v) t_i t_j + g(i - j) - g(i) - g(j) + g(0)` with the autocovariance `g` of `q`, and the
//! linear predictor of least mean square error is `C_fo C_oo^-1`: future on observed. Were everything
//! Gaussian, it would be the conditional mean. It is not (the size of `q` depends on `v`), so a network
//! may do better, but not by looking at second moments alone.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::dataset::{Process, SyntheticConfig};
use super::linear::straight_on;
use super::{Basis, ForecastError, Forecaster, Forecasts, basis_of, window};
use crate::geo::{Displacement, Position};
use crate::vessel::{PeriodicConfig, StochasticConfig};

/// Predicts a known process by the second moments of its positions.
#[derive(Debug, Clone)]
pub struct BestLinearForecaster {
    history_len: usize,
    /// `[horizon][history_len - 1]`: a future position from the observed ones, all relative to the last.
    weights: DMatrix<f64>,
    /// Mean square error at each step of the horizon, on one axis, in square metres.
    variances: DVector<f64>,
}

impl BestLinearForecaster {
    /// For segments drawn as `segments` says, with `history_len` positions seen, up to `horizon` steps.
    /// Nothing where the observed positions have no regular covariance: fewer than two, or a process
    /// without any randomness.
    #[must_use]
    pub fn new(
        process: Process,
        segments: SyntheticConfig,
        history_len: usize,
        horizon: usize,
    ) -> Option<Self> {
        let moments = Moments::of(process, segments, history_len + horizon);
        let observed: Vec<i64> = (1 - history_len as i64..0).collect();
        let future: Vec<i64> = (1..=horizon as i64).collect();
        let among = |rows: &[i64], columns: &[i64]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| moments.covariance(rows[i], columns[j]))
        };
        let (oo, of) = (among(&observed, &observed), among(&observed, &future));
        let weights = oo.cholesky()?.solve(&of).transpose();
        let explained = &weights * &of;
        let variances =
            DVector::from_fn(horizon, |k, _| moments.covariance(future[k], future[k]) - explained[(k, k)]);
        (history_len >= 2).then_some(Self { history_len, weights, variances })
    }

    /// Mean square error at each step on one axis, in square metres, as the theory says.
    #[must_use]
    pub fn variances_m2(&self) -> &[f64] {
        self.variances.as_slice()
    }
}

impl Forecaster for BestLinearForecaster {
    fn name(&self) -> &str {
        "best linear"
    }

    fn history_len(&self) -> usize {
        self.history_len
    }

    /// Beyond the horizon that it was made for, the path holds its last position.
    fn forecast(
        &mut self,
        histories: &[&[Position]],
        horizon: usize,
        forecasts: &mut Forecasts,
    ) -> Result<(), ForecastError> {
        forecasts.reset(histories.len(), horizon);
        for (index, history) in histories.iter().enumerate() {
            let basis = basis_of(history, self.history_len);
            if basis != Basis::Model {
                straight_on(index, history, self.history_len, basis, forecasts)?;
                continue;
            }
            let observed = window(history, self.history_len);
            let now = observed[self.history_len - 1];
            for (k, position) in forecasts.path_mut(index).iter_mut().enumerate() {
                let row = self.weights.row(k.min(self.weights.nrows() - 1));
                let steps = row.iter().zip(observed).map(|(&weight, &seen)| (seen - now) * weight);
                *position = now + steps.fold(Displacement::default(), |sum, step| sum + step);
            }
        }
        Ok(())
    }
}

/// Second moments of one axis.
struct Moments {
    velocity_variance: f64,
    dt_s: f64,
    /// `g(0), g(1), ...` in square metres.
    autocovariance: Vec<f64>,
}

impl Moments {
    fn of(process: Process, segments: SyntheticConfig, lags: usize) -> Self {
        let velocity_variance = segments.component_mps.powi(2) / 3.0;
        let autocovariance = match process {
            Process::Stochastic(config) => stochastic(config, velocity_variance, lags),
            Process::Periodic(config) => periodic(config, velocity_variance, lags),
        };
        Self { velocity_variance, dt_s: segments.dt_s, autocovariance }
    }

    /// Of the positions at steps `i` and `j`, both relative to that at step 0.
    fn covariance(&self, i: i64, j: i64) -> f64 {
        let g = |lag: i64| self.autocovariance[lag.unsigned_abs() as usize];
        self.velocity_variance * self.dt_s.powi(2) * (i * j) as f64 + g(i - j) - g(i) - g(j) + g(0)
    }
}

/// The smoothed wander is an AR(2) with roots `phi` and `gamma = 1 - beta`; its scale has the mean square
/// `E |v|^2 / v_max^2`.
fn stochastic(config: StochasticConfig, velocity_variance: f64, lags: usize) -> Vec<f64> {
    let (phi, gamma) = (config.phi, 1.0 - config.beta);
    let innovation_variance = (config.beta * config.innovation_sd_m).powi(2);
    let scale_square = 2.0 * velocity_variance / config.v_max_mps.powi(2);
    let variance = scale_square * innovation_variance * (1.0 + phi * gamma)
        / ((1.0 - phi * phi) * (1.0 - gamma * gamma) * (1.0 - phi * gamma));
    let mut values = vec![variance, variance * (phi + gamma) / (1.0 + phi * gamma)];
    while values.len() <= lags {
        let [.., before, last] = values[..] else { break };
        values.push((phi + gamma) * last - phi * gamma * before);
    }
    values
}

/// A weave of random phase, as high as the other component of the velocity is fast, plus white noise.
fn periodic(config: PeriodicConfig, velocity_variance: f64, lags: usize) -> Vec<f64> {
    let weave = velocity_variance * config.amplitude_s.powi(2) / 2.0;
    (0..=lags)
        .map(|lag| {
            let noise = if lag == 0 { config.noise_sd_m.powi(2) } else { 0.0 };
            weave * (TAU * lag as f64 / config.period_steps).cos() + noise
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::super::dataset::SyntheticSegments;
    use super::super::{LinearForecaster, rmse_m};
    use super::*;

    const PROCESSES: [fn() -> Process; 2] = [
        || Process::Stochastic(StochasticConfig::default()),
        || Process::Periodic(PeriodicConfig::default()),
    ];

    /// On drawn segments its mean square error is the one that the theory gives, and less than that of
    /// the straight line.
    #[test]
    fn its_error_is_the_theoretical_one() {
        let config = SyntheticConfig::default();
        for process in PROCESSES.map(|make| make()) {
            let source = SyntheticSegments { process, config, history_len: 10, horizon: 40 };
            let segments = source.take(3000, &mut ChaCha8Rng::seed_from_u64(5));
            let histories: Vec<&[Position]> = segments.iter().map(|s| s.history.as_slice()).collect();
            let mut best = BestLinearForecaster::new(process, config, 10, 40).unwrap();
            let expected = 2.0 * best.variances_m2().iter().sum::<f64>() / 40.0;
            let mut forecasts = Forecasts::new();
            let mut mean_square = |forecaster: &mut dyn Forecaster| {
                forecaster.forecast(&histories, 40, &mut forecasts).unwrap();
                let squares = segments.iter().enumerate();
                squares.map(|(i, s)| rmse_m(forecasts.path(i), &s.future).powi(2)).sum::<f64>() / 3000.0
            };
            let measured = mean_square(&mut best);
            assert!((measured / expected - 1.0).abs() < 0.08, "{process:?}: {measured} for {expected}");
            let linear = mean_square(&mut LinearForecaster::over(10));
            assert!(measured < 0.9 * linear, "{process:?}: {measured} against {linear}");
        }
    }

    #[test]
    fn a_history_with_a_gap_falls_back_to_the_line() {
        let process = Process::Stochastic(StochasticConfig::default());
        let mut best = BestLinearForecaster::new(process, SyntheticConfig::default(), 10, 5).unwrap();
        let mut history: Vec<Position> =
            (0..10).map(|k| Position { north_m: f64::from(k), east_m: 0.0 }).collect();
        history[3].east_m = f64::NAN;
        let mut forecasts = Forecasts::new();
        best.forecast(&[&history], 5, &mut forecasts).unwrap();
        assert_eq!(forecasts.basis(0), Basis::Gap);
        assert!((forecasts.path(0)[4].north_m - 14.0).abs() < 1e-9);
    }

    #[test]
    fn one_position_tells_nothing() {
        let process = Process::Stochastic(StochasticConfig::default());
        assert!(BestLinearForecaster::new(process, SyntheticConfig::default(), 1, 5).is_none());
    }
}
