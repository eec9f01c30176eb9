//! `traj_AIS_single_estimates`: four forecasts against recorded tracks (paper, section "Supervised
//! learning" of the maritime study).

use super::forecasts::{MAP_COLUMNS, add_positions, introduced, map, on_map};
use super::product::{DataTable, Drawing, Product};
use crate::forecast::{ForecastError, Forecaster, Forecasts, LstmForecaster, Segment, rmse_m};
use crate::geo::Position;
use crate::report::figure::{Figure, Line, colour};

/// Forecasts shown.
pub const ESTIMATES: usize = 4;

/// Forecasts of four of these segments, evenly spread over them; `None` where there are fewer.
///
/// # Errors
///
/// When a history has no velocity.
pub fn make(
    forecaster: &mut LstmForecaster,
    segments: &[&Segment],
) -> Result<Option<Product>, ForecastError> {
    if segments.len() < ESTIMATES {
        return Ok(None);
    }
    let mut data = DataTable::new(&MAP_COLUMNS);
    let mut forecasts = Forecasts::new();
    let mut panels = Vec::new();
    for k in 0..ESTIMATES {
        let segment = segments[(2 * k + 1) * segments.len() / (2 * ESTIMATES)];
        let horizon = segment.future.len();
        forecaster.forecast(&[&segment.history], horizon, &mut forecasts)?;
        let seen = segment.history.len();
        let way = |future: &[Position]| on_map(&[&segment.history[seen - 1..], future].concat());
        let error_m = rmse_m(forecasts.path(0), &segment.future);
        let title = format!("{}, rmse {error_m:.0} m", segment.route());
        let panel = format!("{}: {}", k + 1, segment.route());
        add_positions(&mut data, &panel, "observed", 1 - seen as i64, &segment.history);
        add_positions(&mut data, &panel, "truth", 1, &segment.future);
        add_positions(&mut data, &panel, "forecast", 1, forecasts.path(0));
        panels.push(map(
            title,
            vec![
                Line::solid("truth", colour::BLUE, way(&segment.future)),
                Line::dashed("forecast", colour::ORANGE, way(forecasts.path(0))),
                Line { width: 3, ..Line::solid("observed", colour::GREEN, on_map(&segment.history)) },
            ],
        ));
    }
    let caption = format!(
        "Four of the {} held-out segments whose course changes by more than the threshold of a curve, evenly spread over \
         them, not chosen by their error. {}. Titles: octants of the course now and at the end, and the root mean square error.",
        segments.len(),
        introduced(forecaster.model()),
    );
    Ok(Some(Product { drawing: Drawing::Figure(Figure { panels, columns: 2 }), data, caption }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::forecasts::tests::{segments, tiny};
    use crate::forecast::ModelKind;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn four_segments_are_forecast() {
        let mut forecaster = tiny(ModelKind::Coastal);
        let source = segments(&forecaster.model().config, 30);
        let drawn = source.take(9, &mut ChaCha8Rng::seed_from_u64(2));
        let drawn: Vec<&Segment> = drawn.iter().collect();
        let product = make(&mut forecaster, &drawn).unwrap().unwrap();
        let count = |of: &str| product.data.rows().iter().filter(|row| row[1] == of.into()).count();
        assert_eq!((count("observed"), count("truth"), count("forecast")), (4 * 75, 4 * 30, 4 * 30));
        assert_eq!(product.to_svg().unwrap().matches("north (km)").count(), 4);
        assert!(make(&mut forecaster, &drawn[..3]).unwrap().is_none());
    }
}
