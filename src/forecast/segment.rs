//! A stretch of a path with its history and what came after, and how a forecast of it is scored.

use serde::Serialize;

use crate::angle::Nautical;
use crate::geo::{Displacement, Position};

/// What a forecaster is shown of a path, and what it has to predict.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Positions seen, oldest first.
    pub history: Vec<Position>,
    /// Where the vessel truly is at the end of the history.
    pub present: Position,
    /// Positions that follow, one for each step of the horizon.
    pub future: Vec<Position>,
    /// The vessel, where the path is a recorded one.
    pub mmsi: Option<u32>,
    /// Time of the first position in seconds since 1970, where the path is a recorded one.
    pub start_unix_s: Option<f64>,
}

impl Segment {
    /// Course made good over the last step of the history.
    #[must_use]
    pub fn course_now(&self) -> Nautical {
        last_course(&self.history)
    }

    /// Course made good over the last step of the horizon.
    #[must_use]
    pub fn course_at_end(&self) -> Nautical {
        last_course(&self.future)
    }

    /// Whether the course at the end of the horizon differs by more than `threshold_rad` from that at
    /// the end of the history.
    #[must_use]
    pub fn has_curve(&self, threshold_rad: f64) -> bool {
        self.course_at_end().turn_from(self.course_now()).abs() > threshold_rad
    }

    /// Moves the whole path.
    pub fn shift(&mut self, by: Displacement) {
        for position in self.history.iter_mut().chain([&mut self.present]).chain(&mut self.future) {
            *position += by;
        }
    }

    /// The route in the widest sense: the octants of the course now and at the end of the horizon, as
    /// in `S-SE`.
    #[must_use]
    pub fn route(&self) -> String {
        format!("{}-{}", octant(self.course_now()), octant(self.course_at_end()))
    }
}

fn last_course(positions: &[Position]) -> Nautical {
    match positions {
        [.., before, last] => (*last - *before).bearing(),
        _ => Nautical::NORTH,
    }
}

fn octant(course: Nautical) -> &'static str {
    const NAMES: [&str; 8] = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];
    NAMES[(course.degrees() / 45.0).round() as usize % 8]
}

/// Root mean square distance between a forecast and the truth, in metres: `sqrt(mean_k e_k^2)`.
#[must_use]
pub fn rmse_m(forecast: &[Position], truth: &[Position]) -> f64 {
    let squares = forecast.iter().zip(truth).map(|(f, t)| f.distance_m(*t).powi(2));
    (squares.sum::<f64>() / truth.len().max(1) as f64).sqrt()
}

/// The quantiles of the paper's figures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// 25 % quantile.
    pub q25: f64,
    /// Median.
    pub q50: f64,
    /// 75 % quantile.
    pub q75: f64,
    /// 90 % quantile.
    pub q90: f64,
}

impl Quantiles {
    /// Of the values given; nothing of none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |probability| quantile(&sorted, probability);
        Some(Self { q25: at(0.25)?, q50: at(0.5)?, q75: at(0.75)?, q90: at(0.9)? })
    }
}

/// A quantile of values in ascending order, linearly interpolated between order statistics; nothing of
/// none.
#[must_use]
pub fn quantile(sorted: &[f64], probability: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let rank = probability.clamp(0.0, 1.0) * last as f64;
    let below = rank as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (sorted[above] - sorted[below]) * (rank - below as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(history: &[(f64, f64)], future: &[(f64, f64)]) -> Segment {
        let positions = |points: &[(f64, f64)]| {
            points.iter().map(|&(north_m, east_m)| Position { north_m, east_m }).collect()
        };
        Segment {
            history: positions(history),
            present: Position::ORIGIN,
            future: positions(future),
            mmsi: None,
            start_unix_s: None,
        }
    }

    #[test]
    fn a_curve_is_a_change_of_course_beyond_the_threshold() {
        let turn = segment(&[(0.0, 0.0), (-1.0, 0.0)], &[(-2.0, 0.0), (-3.0, 1.0)]);
        assert!(turn.has_curve(15_f64.to_radians()));
        assert!(!turn.has_curve(46_f64.to_radians()));
        assert_eq!(turn.route(), "S-SE");
    }

    #[test]
    fn a_route_due_north_wraps() {
        let north = segment(&[(0.0, 0.0), (1.0, -0.01)], &[(2.0, 0.0), (3.0, 0.0)]);
        assert_eq!(north.route(), "N-N");
    }

    #[test]
    fn the_error_is_a_root_mean_square() {
        let a = segment(&[], &[(0.0, 3.0), (4.0, 0.0)]);
        let zero = segment(&[], &[(0.0, 0.0), (0.0, 0.0)]);
        assert!((rmse_m(&a.future, &zero.future) - 12.5_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn quantiles_interpolate_between_values() {
        let quantiles = Quantiles::of(&[4.0, 1.0, 2.0, 3.0, 5.0]).unwrap();
        assert_eq!((quantiles.q25, quantiles.q50, quantiles.q75), (2.0, 3.0, 4.0));
        assert!((quantiles.q90 - 4.6).abs() < 1e-12);
        assert_eq!(Quantiles::of(&[]), None);
    }
}
