//! The baseline of every table: straight on at the least-squares velocity of the history.

use super::{Basis, ForecastError, Forecaster, Forecasts, basis_of, window};
use crate::geo::{Displacement, Position};

/// Least-squares velocity over the history, from the last position.
///
/// It reads as many positions as the forecaster it stands beside. A history with gaps or too few
/// positions gives the line through what there is, from the last finite position on.
#[derive(Debug, Clone)]
pub struct LinearForecaster {
    history_len: usize,
}

impl LinearForecaster {
    /// Reads the last `history_len` positions, two at least.
    #[must_use]
    pub fn over(history_len: usize) -> Self {
        Self { history_len: history_len.max(2) }
    }
}

impl Forecaster for LinearForecaster {
    fn name(&self) -> &str {
        "linear"
    }

    fn history_len(&self) -> usize {
        self.history_len
    }

    fn forecast(
        &mut self,
        histories: &[&[Position]],
        horizon: usize,
        forecasts: &mut Forecasts,
    ) -> Result<(), ForecastError> {
        forecasts.reset(histories.len(), horizon);
        for (index, history) in histories.iter().enumerate() {
            let basis = basis_of(history, self.history_len);
            straight_on(index, history, self.history_len, basis, forecasts)?;
        }
        Ok(())
    }
}

/// Writes path `index` as a straight line and notes `basis` beside it.
pub(super) fn straight_on(
    index: usize,
    history: &[Position],
    history_len: usize,
    basis: Basis,
    forecasts: &mut Forecasts,
) -> Result<(), ForecastError> {
    let window = window(history, history_len);
    let Some(line) = Line::through(window) else {
        let finite = window.iter().filter(|position| position.is_finite()).count();
        return Err(ForecastError::NoVelocity { history: index, finite, window: window.len() });
    };
    forecasts.bases[index] = basis;
    for (k, position) in forecasts.path_mut(index).iter_mut().enumerate() {
        *position = line.last + line.per_step * (line.age_steps + (k + 1) as f64);
    }
    Ok(())
}

/// The way of a vessel that keeps its mean velocity.
struct Line {
    last: Position,
    per_step: Displacement,
    /// Steps from `last` to the end of the window.
    age_steps: f64,
}

impl Line {
    /// Through the finite positions of a window; nothing where there are fewer than two.
    fn through(window: &[Position]) -> Option<Self> {
        let seen = || window.iter().enumerate().filter(|(_, position)| position.is_finite());
        let count = seen().count();
        if count < 2 {
            return None;
        }
        let mean_step = seen().map(|(k, _)| k as f64).sum::<f64>() / count as f64;
        let (last_step, last) = seen().next_back()?;
        let mut moment = Displacement::default();
        let mut spread = 0.0;
        for (k, &position) in seen() {
            let offset = k as f64 - mean_step;
            moment = moment + (position - *last) * offset;
            spread += offset * offset;
        }
        Some(Self {
            last: *last,
            per_step: moment * (1.0 / spread),
            age_steps: (window.len() - 1 - last_step) as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MISSING: Position = Position { north_m: f64::NAN, east_m: f64::NAN };

    fn at(north_m: f64, east_m: f64) -> Position {
        Position { north_m, east_m }
    }

    fn forecast(history: &[Position], horizon: usize) -> Result<Forecasts, ForecastError> {
        let mut forecasts = Forecasts::new();
        LinearForecaster::over(10).forecast(&[history], horizon, &mut forecasts)?;
        Ok(forecasts)
    }

    #[test]
    fn the_velocity_is_the_least_squares_slope() {
        // numpy.polyfit(range(4), [0, 1, 1, 3], 1)[0] = 0.9
        let history = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 0.0), at(3.0, 0.0)];
        let mut forecasts = Forecasts::new();
        LinearForecaster::over(4).forecast(&[&history], 2, &mut forecasts).unwrap();
        assert_eq!(forecasts.basis(0), Basis::Model);
        assert!((forecasts.path(0)[1].north_m - 4.8).abs() < 1e-12);
    }

    #[test]
    fn a_short_history_is_extrapolated_and_said_to_be_short() {
        let forecasts = forecast(&[at(0.0, 0.0), at(2.0, 1.0)], 3).unwrap();
        assert_eq!(forecasts.basis(0), Basis::TooShort);
        assert_eq!(forecasts.fallbacks(), 1);
        assert_eq!(forecasts.path(0)[2], at(8.0, 4.0));
    }

    #[test]
    fn gaps_are_bridged_on_the_time_grid() {
        let mut history: Vec<Position> = (0..12).map(|k| at(f64::from(k), 5.0)).collect();
        history[6] = MISSING;
        history[11] = MISSING;
        let forecasts = forecast(&history, 2).unwrap();
        assert_eq!(forecasts.basis(0), Basis::Gap);
        assert!(forecasts.path(0)[0].distance_m(at(12.0, 5.0)) < 1e-9);
    }

    #[test]
    fn without_two_positions_there_is_no_forecast() {
        let error = forecast(&[MISSING, at(1.0, 1.0), MISSING], 2).unwrap_err();
        assert_eq!(error, ForecastError::NoVelocity { history: 0, finite: 1, window: 3 });
        assert!(forecast(&[], 2).is_err());
    }

    #[test]
    fn the_past_is_predicted_nearest_first() {
        let history: Vec<Position> = (0..10).map(|k| at(f64::from(k), 0.0)).collect();
        let mut forecasts = Forecasts::new();
        LinearForecaster::over(10).forecast_both_ways(&[&history], 2, &mut forecasts).unwrap();
        assert_eq!(forecasts.len(), 2);
        assert!((forecasts.path(0)[1].north_m - 11.0).abs() < 1e-9);
        assert!((forecasts.path(1)[1].north_m + 2.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn steady_motion_is_predicted_exactly(
            start in (-1e4..1e4_f64, -1e4..1e4_f64),
            step in (-60.0..60.0_f64, -60.0..60.0_f64),
            length in 2..40_usize,
        ) {
            let way = |k: f64| at(start.0 + k * step.0, start.1 + k * step.1);
            let history: Vec<Position> = (0..length).map(|k| way(k as f64)).collect();
            let forecasts = forecast(&history, 100).unwrap();
            let truth = way((length + 99) as f64);
            prop_assert!(forecasts.path(0)[99].distance_m(truth) < 1e-6);
        }
    }
}
