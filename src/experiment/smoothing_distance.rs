//! `smoothing_distance`: raw and smoothed distance, with the sampled and the refined CPA marked (paper,
//! section "Collision risk estimation").

use super::product::{DataTable, Drawing, Product, data_row};
use crate::cpa::refined::{RefineConfig, Refiner};
use crate::cpa::sampled::DistanceCurve;
use crate::cpa::{Cpa, StraightMotion};
use crate::env::open_water::{Field, Obstacle, OpenWaterConfig, to_position};
use crate::forecast::{ForecastError, Forecaster, Forecasts};
use crate::geo::Position;
use crate::report::figure::{Figure, LegendPlace, Line, Panel, colour};

/// Steps either side of the sampled CPA in the close-up.
const NEAR_STEPS: f64 = 3.0;
/// Parts in which the close-up draws a step.
const PARTS: u32 = 20;

/// The distance between own ship and a target ship over time, and its minima.
#[derive(Debug)]
pub struct Distances<'a> {
    /// Raw and smoothed.
    pub curve: &'a DistanceCurve,
    /// Minimum over the time steps.
    pub sampled: Cpa,
    /// Minimum over all times.
    pub refined: Cpa,
}

impl Distances<'_> {
    /// The whole, and the steps around the minimum, where both minima differ.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let curve = self.curve;
        let dots = |width, label: String, colour, points| Line { width, ..Line::dots(label, colour, points) };
        let mark = |name: &str, cpa: Cpa, colour| {
            let label = format!("{name}: {:.2} m at {:.2} s", cpa.distance_m, cpa.time_s);
            dots(5, label, colour, vec![(cpa.time_s, cpa.distance_m)])
        };
        let marks = || {
            [
                mark("sampled CPA", self.sampled, colour::ORANGE),
                mark("refined CPA", self.refined, colour::GREEN),
            ]
        };
        let unnamed = |line: Line| Line { label: String::new(), ..line };
        let raw = curve.raw_m().iter().enumerate().map(|(step, &m)| (curve.time_s(step), m)).collect();
        let sampled: Vec<_> = curve
            .smoothed_m()
            .iter()
            .enumerate()
            .map(|(index, &m)| (curve.smoothed_time_s(index), m))
            .collect();

        let mut whole = vec![
            Line { width: 1, ..Line::solid("distance", colour::GREY, raw) },
            Line::solid("smoothed distance", colour::BLUE, sampled.clone()),
        ];
        whole.extend(marks().map(unnamed));

        let near = |time_s: f64| (time_s - self.sampled.time_s).abs() <= NEAR_STEPS * curve.dt_s() + 1e-9;
        let within = (0..sampled.len().saturating_sub(1))
            .flat_map(|index| (0..=PARTS).map(move |part| (index, f64::from(part) / f64::from(PARTS))));
        let smooth = within
            .map(|(index, part)| {
                (curve.smoothed_time_s(index) + part * curve.dt_s(), curve.smoothed_within_m(index, part))
            })
            .filter(|point| near(point.0))
            .collect();
        let steps = sampled.into_iter().filter(|point| near(point.0)).collect();
        let mut closeup = vec![
            unnamed(Line::solid("", colour::BLUE, smooth)),
            dots(3, "time steps".to_owned(), colour::BLUE, steps),
        ];
        closeup.extend(marks());

        let panel = |title: String, lines| Panel {
            title,
            x_label: "time from now (s)".to_owned(),
            y_label: "distance (m)".to_owned(),
            lines,
            legend: LegendPlace::UpperMiddle,
            ..Panel::default()
        };
        let smoothing = format!("Distance, smoothed over {} steps either side", curve.half_width());
        let around = panel("Around the smallest smoothed distance".to_owned(), closeup);
        Figure { panels: vec![panel(smoothing, whole), Panel { close_up: true, ..around }], columns: 2 }
    }

    fn data(&self) -> DataTable {
        let curve = self.curve;
        let mut data = DataTable::new(&["series", "time_s", "distance_m"]);
        for (step, &raw_m) in curve.raw_m().iter().enumerate() {
            data.push(data_row!["distance", curve.time_s(step), raw_m]);
        }
        for (index, &smoothed_m) in curve.smoothed_m().iter().enumerate() {
            data.push(data_row!["smoothed distance", curve.smoothed_time_s(index), smoothed_m]);
        }
        for (name, cpa) in [("sampled CPA", self.sampled), ("refined CPA", self.refined)] {
            data.push(data_row![name, cpa.time_s, cpa.distance_m]);
        }
        data
    }
}

/// The agent and a forecast obstacle at the start of the open-water episode of `seed`: the first whose
/// CPA lies in the middle half of the forecast. `None` where the episode has none.
///
/// # Errors
///
/// When an obstacle's history has no velocity.
pub fn make(
    config: &OpenWaterConfig,
    forecaster: &mut dyn Forecaster,
    episode: u64,
    seed: u64,
) -> Result<Option<Product>, ForecastError> {
    let field = Field::new(config, seed);
    let own = StraightMotion { position: field.agent().position, velocity: field.agent().velocity };
    let reach_s = config.dt_s * config.forecast_steps as f64;
    let mut curve = DistanceCurve::new(config.smoothing_half_width);
    for (index, obstacle) in field.obstacles().iter().enumerate() {
        predicted(&mut curve, own, obstacle, forecaster, config)?;
        let sampled = curve.closest();
        if !(0.25 * reach_s..=0.75 * reach_s).contains(&sampled.time_s) {
            continue;
        }
        let refined = Refiner::new(RefineConfig::default()).closest(&curve).cpa;
        let distances = Distances { curve: &curve, sampled, refined };
        let caption = format!(
            "Distance between the agent, straight on, and obstacle {index} of benchmark episode {episode}, observed over {} \
             steps, forecast and backcast over {} by {}. Its own motion makes the distance oscillate; the mean over {} steps \
             takes that out. DCPA and TCPA by time steps: {:.1} m at {:.0} s; over all times: {:.1} m at {:.1} s.",
            obstacle.history().len(),
            config.forecast_steps,
            forecaster.name(),
            2 * config.smoothing_half_width + 1,
            sampled.distance_m,
            sampled.time_s,
            refined.distance_m,
            refined.time_s,
        );
        return Ok(Some(Product {
            drawing: Drawing::Figure(distances.figure()),
            data: distances.data(),
            caption,
        }));
    }
    Ok(None)
}

/// Backcast, history and forecast in one row.
fn predicted(
    curve: &mut DistanceCurve,
    own: StraightMotion,
    obstacle: &Obstacle,
    forecaster: &mut dyn Forecaster,
    config: &OpenWaterConfig,
) -> Result<(), ForecastError> {
    let history: Vec<Position> = obstacle.history().map(to_position).collect();
    let mut forecasts = Forecasts::new();
    forecaster.forecast_both_ways(&[&history], config.forecast_steps, &mut forecasts)?;
    let past = forecasts.path(1).iter().rev();
    let row = past.chain(&history).chain(forecasts.path(0)).map(|position| position.xy());
    curve.fill(own, row, config.forecast_steps + history.len() - 1, config.dt_s);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Cell;
    use crate::forecast::LinearForecaster;

    #[test]
    fn both_minima_are_marked_and_the_refined_one_is_the_smaller() {
        let config = OpenWaterConfig::default();
        let mut forecaster = LinearForecaster::over(10);
        let product = make(&config, &mut forecaster, 0, 0).unwrap().unwrap();
        let rows = product.data.rows();
        // 100 steps back, 10 observed, 100 ahead; the smoothed curve loses 10 at either end.
        assert_eq!(rows.len(), 210 + 190 + 2);
        let distance = |row: &[Cell]| match row[2] {
            Cell::Number(value) => value,
            _ => f64::NAN,
        };
        assert!(distance(&rows[401]) <= distance(&rows[400]) + 1e-6);
        let svg = product.to_svg().unwrap();
        assert!(svg.contains("refined CPA") && svg.contains("smoothed distance"));
    }
}
