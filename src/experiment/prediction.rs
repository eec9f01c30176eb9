//! `AR1_prediction` and `sinus_prediction`: one forecast and one backcast against the truth (paper,
//! section "Trajectory prediction").

use super::forecasts::{MAP_COLUMNS, add_positions, introduced, map, on_map};
use super::product::{DataTable, Drawing, Product};
use crate::forecast::{ForecastError, Forecaster, Forecasts, LstmForecaster};
use crate::geo::Position;
use crate::report::figure::{Figure, Line, Stroke, colour};

/// Positions that [`make`] needs of a path: horizon, history, horizon.
#[must_use]
pub fn path_len(forecaster: &LstmForecaster) -> usize {
    let kind = forecaster.model().config.kind;
    kind.history_len() + 2 * kind.horizon()
}

/// One panel for each model with a path of its own motion, whose middle it is shown.
///
/// # Errors
///
/// When a path has no velocity.
///
/// # Panics
///
/// When a path is not [`path_len`] long.
pub fn make(shown: &mut [(LstmForecaster, Vec<Position>)], path_seed: u64) -> Result<Product, ForecastError> {
    let mut data = DataTable::new(&MAP_COLUMNS);
    let (mut panels, mut models) = (Vec::new(), Vec::new());
    for (forecaster, path) in shown {
        assert_eq!(path.len(), path_len(forecaster), "horizon, history, horizon");
        let kind = forecaster.model().config.kind;
        let (horizon, seen) = (kind.horizon(), kind.history_len());
        let (past, rest) = path.split_at(horizon);
        let (observed, future) = rest.split_at(seen);
        let mut forecasts = Forecasts::new();
        forecaster.forecast_both_ways(&[observed], horizon, &mut forecasts)?;
        let forecast = [&observed[seen - 1..], forecasts.path(0)].concat();
        let backcast = [&observed[..1], forecasts.path(1)].concat();

        let name = &forecaster.model().config.name;
        let now = seen as i64 - 1;
        add_positions(&mut data, name, "truth", -now - horizon as i64, &[past, observed, future].concat());
        add_positions(&mut data, name, "observed", -now, observed);
        add_positions(&mut data, name, "forecast", 1, forecasts.path(0));
        let backwards: Vec<Position> = forecasts.path(1).iter().rev().copied().collect();
        add_positions(&mut data, name, "backcast", -now - horizon as i64, &backwards);
        panels.push(map(
            name.clone(),
            vec![
                Line::solid("truth", colour::BLUE, on_map(&[past, observed, future].concat())),
                Line::solid("forecast", colour::ORANGE, on_map(&forecast)),
                Line::dashed("backcast", colour::PURPLE, on_map(&backcast)),
                Line::marks("observed", colour::GREEN, Stroke::Dots, 3, on_map(observed)),
            ],
        ));
        models.push(format!(
            "{}; it sees {seen} positions, {} s apart, and forecasts and backcasts {horizon}.",
            introduced(forecaster.model()),
            forecaster.model().config.dt_s(),
        ));
    }
    let columns = panels.len().min(2);
    let caption =
        format!("{} The path is number {path_seed} of those that no training draws.", models.join(" "));
    Ok(Product { drawing: Drawing::Figure(Figure { panels, columns }), data, caption })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::forecasts::tests::{path, tiny};
    use crate::forecast::ModelKind;

    #[test]
    fn past_and_future_are_both_predicted() {
        let forecaster = tiny(ModelKind::OpenWater);
        let path = path(&forecaster.model().config, path_len(&forecaster));
        let product = make(&mut [(forecaster, path)], 5).unwrap();
        let count = |of: &str| product.data.rows().iter().filter(|row| row[1] == of.into()).count();
        assert_eq!(
            (count("truth"), count("observed"), count("forecast"), count("backcast")),
            (210, 10, 100, 100)
        );
        assert!(product.caption.contains("tiny: 3 updates, seed 3"), "{}", product.caption);
        assert!(product.to_svg().unwrap().contains("backcast"));
    }
}
