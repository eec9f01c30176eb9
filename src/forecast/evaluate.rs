//! How good a forecaster is on held-out segments, beside the straight line on the same ones.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{ForecastError, Forecaster, Forecasts, LinearForecaster, Quantiles, Segment, rmse_m};
use crate::geo::{Displacement, Position};

/// What is measured beside the quantiles over all segments.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EvaluationConfig {
    /// A segment has a curve if its course changes by more than this over the horizon, in degrees.
    pub curve_deg: f64,
    /// Standard deviations of sensor noise on the history to test with, in metres on each axis.
    pub noise_m: Vec<f64>,
    /// Seed of that noise.
    pub noise_seed: u64,
    /// Routes with fewer segments than this are counted together as `other`.
    pub route_segments: usize,
    /// Segments forecast at a time.
    pub batch: usize,
}

impl Default for EvaluationConfig {
    fn default() -> Self {
        Self {
            curve_deg: 15.0,
            noise_m: vec![0.0, 5.0, 10.0, 20.0],
            noise_seed: 0,
            route_segments: 30,
            batch: 64,
        }
    }
}

/// Errors of a set of segments: quantiles over the segments of `sqrt(mean_k e_k^2)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Errors {
    /// Segments in the set.
    pub segments: usize,
    /// The forecaster.
    pub rmse_m: Quantiles,
    /// The straight line on the same segments.
    pub linear_rmse_m: Quantiles,
    /// Median of the forecaster over median of the straight line.
    pub median_ratio: f64,
}

/// Errors with sensor noise on the history; the truth stays true.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseErrors {
    /// Standard deviation on each axis, in metres.
    pub sigma_m: f64,
    /// The errors.
    #[serde(flatten)]
    pub errors: Errors,
}

/// Errors of the segments of one route.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RouteErrors {
    /// Octants of the course now and at the end of the horizon.
    pub route: String,
    /// The errors.
    #[serde(flatten)]
    pub errors: Errors,
}

/// The distances `e_k` of all segments, step by step: what the figures show.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StepErrors {
    /// Quantiles over segments at each step of the horizon, for the forecaster.
    pub model: Vec<Quantiles>,
    /// The same for the straight line.
    pub linear: Vec<Quantiles>,
}

/// Everything measured of one forecaster on one set of segments.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Name of the model.
    pub model: String,
    /// Number of segments.
    pub segments: usize,
    /// Steps forecast.
    pub horizon_steps: usize,
    /// Quantiles over segments of `sqrt(mean_k e_k^2)`, in metres.
    pub rmse_m: Quantiles,
    /// The same for the straight line on the same segments.
    pub linear_rmse_m: Quantiles,
    /// Median of the forecaster over median of the straight line.
    pub median_ratio: f64,
    /// The best linear predictor of the known process, where the motion is a known process.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub best_linear_rmse_m: Option<Quantiles>,
    /// Forecasts that fell back to the straight line.
    pub fallbacks: usize,
    /// The segments with a curve.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curve: Option<Errors>,
    /// The segments of vessels that training never saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen_vessels: Option<Errors>,
    /// With sensor noise on the history.
    pub noise: Vec<NoiseErrors>,
    /// By route, most frequent first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub routes: Vec<RouteErrors>,
    /// Error over the horizon.
    #[serde(skip)]
    pub steps: StepErrors,
}

/// Why nothing could be measured.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EvaluationError {
    /// No segment to measure on.
    #[error("there are no held-out segments to evaluate on: no track is long enough for history and horizon")]
    NoSegments,
    /// A standard deviation of noise that is none.
    #[error("`noise_m` has {0}; a standard deviation is finite and not negative")]
    Noise(f64),
    /// A history without velocity.
    #[error(transparent)]
    Forecast(#[from] ForecastError),
}

/// Measures a forecaster on segments of equal horizon; `seen` tells which vessels trained it.
///
/// # Errors
///
/// When there are no segments, a history has no velocity, or a noise level is not a standard deviation.
pub fn evaluate(
    forecaster: &mut dyn Forecaster,
    segments: &[Segment],
    seen: &dyn Fn(u32) -> bool,
    config: &EvaluationConfig,
) -> Result<Evaluation, EvaluationError> {
    let mut linear = LinearForecaster::over(forecaster.history_len());
    let clean = measure(forecaster, segments, 0.0, config)?;
    let straight = measure(&mut linear, segments, 0.0, config)?;
    let errors_of = |chosen: &dyn Fn(&Segment) -> bool| {
        let pick = |scores: &Scores| scores.of_segments(segments, chosen);
        errors(&pick(&clean), &pick(&straight))
    };
    let all = errors(&clean.rmse_m, &straight.rmse_m).ok_or(EvaluationError::NoSegments)?;

    let mut noise = Vec::new();
    for &sigma_m in &config.noise_m {
        let model = measure(forecaster, segments, sigma_m, config)?;
        let line = measure(&mut linear, segments, sigma_m, config)?;
        noise.extend(errors(&model.rmse_m, &line.rmse_m).map(|errors| NoiseErrors { sigma_m, errors }));
    }
    let recorded = segments.iter().any(|segment| segment.mmsi.is_some());
    let curve_rad = config.curve_deg.to_radians();
    Ok(Evaluation {
        model: forecaster.name().to_owned(),
        segments: segments.len(),
        horizon_steps: segments.first().map_or(0, |segment| segment.future.len()),
        rmse_m: all.rmse_m,
        linear_rmse_m: all.linear_rmse_m,
        median_ratio: all.median_ratio,
        best_linear_rmse_m: None,
        fallbacks: clean.fallbacks,
        curve: recorded.then(|| errors_of(&|segment| segment.has_curve(curve_rad))).flatten(),
        unseen_vessels: errors_of(&|segment| segment.mmsi.is_some_and(|mmsi| !seen(mmsi))),
        noise,
        routes: if recorded { by_route(segments, &errors_of, config.route_segments) } else { Vec::new() },
        steps: StepErrors { model: clean.step_quantiles(), linear: straight.step_quantiles() },
    })
}

/// Quantiles of a further forecaster on the same segments, without noise.
///
/// # Errors
///
/// As [`evaluate`].
pub fn quantiles_of(
    forecaster: &mut dyn Forecaster,
    segments: &[Segment],
    config: &EvaluationConfig,
) -> Result<Quantiles, EvaluationError> {
    let scores = measure(forecaster, segments, 0.0, config)?;
    Quantiles::of(&scores.rmse_m).ok_or(EvaluationError::NoSegments)
}

fn errors(model: &[f64], linear: &[f64]) -> Option<Errors> {
    let (rmse_m, linear_rmse_m) = (Quantiles::of(model)?, Quantiles::of(linear)?);
    Some(Errors {
        segments: model.len(),
        rmse_m,
        linear_rmse_m,
        median_ratio: rmse_m.q50 / linear_rmse_m.q50,
    })
}

/// Errors of the segments that a condition chooses.
type ErrorsOf<'a> = dyn Fn(&dyn Fn(&Segment) -> bool) -> Option<Errors> + 'a;

fn by_route(segments: &[Segment], errors_of: &ErrorsOf<'_>, least: usize) -> Vec<RouteErrors> {
    let mut counts = BTreeMap::<String, usize>::new();
    for segment in segments {
        *counts.entry(segment.route()).or_default() += 1;
    }
    counts.retain(|_, count| *count >= least);
    let mut routes: Vec<RouteErrors> = counts
        .keys()
        .filter_map(|route| {
            let errors = errors_of(&|segment| segment.route() == *route)?;
            Some(RouteErrors { route: route.clone(), errors })
        })
        .collect();
    routes.sort_by_key(|route| std::cmp::Reverse(route.errors.segments));
    let other = errors_of(&|segment| !counts.contains_key(&segment.route()));
    routes.extend(other.map(|errors| RouteErrors { route: "other".to_owned(), errors }));
    routes
}

/// Errors of one forecaster, segment by segment.
struct Scores {
    rmse_m: Vec<f64>,
    /// `e_k` of all segments, by step.
    distances_m: Vec<Vec<f64>>,
    fallbacks: usize,
}

impl Scores {
    fn of_segments(&self, segments: &[Segment], chosen: &dyn Fn(&Segment) -> bool) -> Vec<f64> {
        let pairs = segments.iter().zip(&self.rmse_m);
        pairs.filter(|(segment, _)| chosen(segment)).map(|(_, &rmse_m)| rmse_m).collect()
    }

    fn step_quantiles(&self) -> Vec<Quantiles> {
        self.distances_m.iter().filter_map(|distances| Quantiles::of(distances)).collect()
    }
}

/// Forecasts every segment from its history plus noise.
fn measure(
    forecaster: &mut dyn Forecaster,
    segments: &[Segment],
    sigma_m: f64,
    config: &EvaluationConfig,
) -> Result<Scores, EvaluationError> {
    let noise = Normal::new(0.0, sigma_m)
        .ok()
        .filter(|_| sigma_m >= 0.0 && sigma_m.is_finite())
        .ok_or(EvaluationError::Noise(sigma_m))?;
    let horizon = segments.first().map_or(0, |segment| segment.future.len());
    let mut rng = ChaCha8Rng::seed_from_u64(config.noise_seed);
    let mut scores = Scores { rmse_m: Vec::new(), distances_m: vec![Vec::new(); horizon], fallbacks: 0 };
    let mut forecasts = Forecasts::new();
    for chunk in segments.chunks(config.batch.max(1)) {
        let mut disturbed = |position: &Position| {
            let [north_m, east_m] = [noise.sample(&mut rng), noise.sample(&mut rng)];
            *position + Displacement { north_m, east_m }
        };
        let histories: Vec<Vec<Position>> =
            chunk.iter().map(|segment| segment.history.iter().map(&mut disturbed).collect()).collect();
        let slices: Vec<&[Position]> = histories.iter().map(Vec::as_slice).collect();
        forecaster.forecast(&slices, horizon, &mut forecasts)?;
        scores.fallbacks += forecasts.fallbacks();
        for (index, segment) in chunk.iter().enumerate() {
            let path = forecasts.path(index);
            scores.rmse_m.push(rmse_m(path, &segment.future));
            for (k, (forecast, truth)) in path.iter().zip(&segment.future).enumerate() {
                scores.distances_m[k].push(forecast.distance_m(*truth));
            }
        }
    }
    Ok(scores)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(from: usize, count: usize, turn_after: usize) -> Vec<Position> {
        (from..from + count)
            .map(|k| {
                let turned = k.saturating_sub(turn_after) as f64;
                Position { north_m: k as f64 - turned, east_m: turned }
            })
            .collect()
    }

    fn segment(mmsi: u32, turn_after: usize) -> Segment {
        Segment {
            history: path(0, 10, turn_after),
            present: path(9, 1, turn_after)[0],
            future: path(10, 4, turn_after),
            mmsi: Some(mmsi),
            start_unix_s: Some(0.0),
        }
    }

    #[test]
    fn subsets_are_told_apart() {
        let mut segments = vec![segment(1, 99); 3];
        segments.push(segment(2, 11));
        let config = EvaluationConfig { noise_m: vec![0.0, 1.0], route_segments: 2, ..Default::default() };
        let mut forecaster = LinearForecaster::over(10);
        let evaluation = evaluate(&mut forecaster, &segments, &|mmsi| mmsi == 1, &config).unwrap();
        assert_eq!((evaluation.segments, evaluation.horizon_steps), (4, 4));
        assert!(evaluation.rmse_m.q50 < 1e-9);
        let curve = evaluation.curve.unwrap();
        // The line goes on north while the vessel goes east from step 12 on: e = (0, 0, sqrt 2, 2 sqrt 2).
        assert!((curve.rmse_m.q50 - 2.5_f64.sqrt()).abs() < 1e-9);
        assert_eq!(evaluation.unseen_vessels.unwrap().segments, 1);
        let routes: Vec<_> =
            evaluation.routes.iter().map(|r| (r.route.as_str(), r.errors.segments)).collect();
        assert_eq!(routes, [("N-N", 3), ("other", 1)]);
        assert!(evaluation.noise[1].errors.rmse_m.q50 > 0.1);
        assert!((evaluation.steps.model[3].q90 - 0.7 * 8_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn the_report_has_the_promised_keys() {
        let mut forecaster = LinearForecaster::over(10);
        let evaluation =
            evaluate(&mut forecaster, &[segment(1, 11)], &|_| true, &EvaluationConfig::default()).unwrap();
        let json = serde_json::to_value(&evaluation).unwrap();
        for key in ["q25", "q50", "q75", "q90"] {
            assert!(json["rmse_m"][key].is_f64() && json["linear_rmse_m"][key].is_f64());
        }
        assert_eq!(json["model"], "linear");
        assert_eq!(json["segments"], 1);
        assert_eq!(json["horizon_steps"], 4);
        assert_eq!(json["noise"][3]["sigma_m"], 20.0);
    }

    #[test]
    fn nothing_to_measure_is_an_error() {
        let mut forecaster = LinearForecaster::over(10);
        let none = evaluate(&mut forecaster, &[], &|_| true, &EvaluationConfig::default());
        assert_eq!(none, Err(EvaluationError::NoSegments));
        let config = EvaluationConfig { noise_m: vec![-1.0], ..Default::default() };
        let negative = evaluate(&mut forecaster, &[segment(1, 11)], &|_| true, &config);
        assert_eq!(negative, Err(EvaluationError::Noise(-1.0)));
    }
}
