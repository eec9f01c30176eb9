//! `AIS_env_situations`: the two coastal scenarios (paper, section "Reinforcement learning environment" of
//! the maritime study).

use super::forecasts::{MAP_COLUMNS, add_positions, map, on_map};
use super::product::{DataTable, Drawing, Product};
use crate::env::coastal::{CoastalConfig, Opening};
use crate::forecast::{ForecastError, Forecaster, Forecasts};
use crate::geo::{Displacement, Position};
use crate::report::figure::{Figure, Line, Stroke, colour};
use crate::scenario::encounter_starts::HeadOnKind;
use crate::track::Track;
use crate::vessel::Motion;

/// An episode that is shown.
pub struct Situation<'a> {
    /// How it starts.
    pub opening: &'a Opening,
    /// The track of obstacle 1.
    pub track: &'a Track,
    /// Its number among the benchmark episodes.
    pub episode: u64,
}

/// One panel for each situation.
///
/// # Errors
///
/// When the history of obstacle 1 has no velocity.
pub fn make(
    situations: &[Situation<'_>],
    config: &CoastalConfig,
    forecaster: &mut dyn Forecaster,
) -> Result<Product, ForecastError> {
    let mut data = DataTable::new(&MAP_COLUMNS);
    let (mut panels, mut shown) = (Vec::new(), Vec::new());
    let mut forecasts = Forecasts::new();
    for Situation { opening, track, episode } in situations {
        let (title, what) = match opening.kind {
            HeadOnKind::BeforeCurve => ("Scenario 1: before a curve to port", "1"),
            HeadOnKind::StraightOn => ("Scenario 2: straight on", "2"),
        };
        let steps = (config.head_on.future_s / track.dt_s).round() as usize;
        let start = opening.start.index;
        let history = &track.positions[(start + 1).saturating_sub(config.history_positions)..=start];
        let truth = &track.positions[start..(start + 1 + steps).min(track.positions.len())];
        forecaster.forecast(&[history], config.forecast_steps, &mut forecasts)?;
        let forecast = [&truth[..1], &forecasts.path(0)[..steps.min(config.forecast_steps)]].concat();
        let held = |step: usize| {
            let way_m = config.head_on.own_speed_mps * track.dt_s * step as f64;
            opening.own_position + Displacement::towards(opening.own_heading, way_m)
        };
        let own: Vec<Position> = (0..=steps).map(held).collect();

        for (series, first, positions) in [
            ("obstacle 1, observed", 1 - history.len() as i64, history),
            ("obstacle 1, true", 0, truth),
            ("obstacle 1, forecast", 0, &forecast[..]),
            ("own ship, holding course", 0, &own[..]),
        ] {
            add_positions(&mut data, title, series, first, positions);
        }
        let mut lines = vec![
            Line { width: 4, ..Line::solid("obstacle 1, true", colour::GREY, on_map(truth)) },
            Line::solid("obstacle 1, observed", colour::GREEN, on_map(history)),
            Line::solid("obstacle 1, forecast", colour::ORANGE, on_map(&forecast)),
            Line::dashed("own ship, holding course", colour::BLUE, on_map(&own)),
        ];
        let mut starts = vec![truth[0]];
        for (index, linear) in opening.linear.iter().enumerate() {
            let way: Vec<Position> = (0..=steps as i64).map(|step| linear.state(step).position).collect();
            add_positions(&mut data, title, &format!("obstacle {}", index + 2), 0, &way);
            starts.push(way[0]);
            let label = if index == 0 { "obstacles on straight lines" } else { "" };
            lines.push(Line { width: 1, ..Line::dashed(label, colour::PURPLE, on_map(&way)) });
        }
        lines.push(Line::marks("obstacles now", colour::BLACK, Stroke::Dots, 4, on_map(&starts)));
        lines.push(Line::marks("own ship now", colour::BLUE, Stroke::Squares, 4, on_map(&own[..1])));
        panels
            .push(crate::report::figure::Panel { size_px: Some((560, 500)), ..map(title.to_owned(), lines) });
        shown.push(format!(
            "scenario {what}: benchmark episode {episode}, closest distance to obstacle 1 if course is held {:.0} m",
            closest_m(&own, truth)
        ));
    }
    let columns = panels.len().min(2);
    let caption = format!(
        "The first benchmark episode of each scenario on held-out tracks, over {:.0} s: {}. Circles touch at {:.0} m. The \
         forecast is of {}; the other obstacles move in straight lines.",
        config.head_on.future_s,
        shown.join("; "),
        config.collision_distance_m,
        forecaster.name(),
    );
    Ok(Product { drawing: Drawing::Figure(Figure { panels, columns }), data, caption })
}

/// Closest distance of two paths on one time grid, straight between positions.
fn closest_m(a: &[Position], b: &[Position]) -> f64 {
    let apart: Vec<_> = a.iter().zip(b).map(|(a, b)| a.xy() - b.xy()).collect();
    let within = |pair: &[nalgebra::Vector2<f64>]| {
        let way = pair[1] - pair[0];
        let fraction = if way.norm_squared() > 0.0 { -pair[0].dot(&way) / way.norm_squared() } else { 0.0 };
        (pair[0] + way * fraction.clamp(0.0, 1.0)).norm()
    };
    apart.windows(2).map(within).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forecast::LinearForecaster;
    use crate::scenario::encounter_starts::{HeadOnStarts, head_on_pose};
    use crate::track::VesselParticulars;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Straight on at 8 m/s for a while, then a right angle to port.
    fn track() -> Track {
        let positions = (0..400).map(|k| {
            let along = 40.0 * f64::from(k.min(250));
            Position { north_m: along, east_m: -40.0 * f64::from((k - 250).max(0)) }
        });
        Track {
            mmsi: 219_000_001,
            start_unix_s: 1_606_780_800,
            dt_s: 5.0,
            positions: positions.collect(),
            particulars: VesselParticulars::default(),
        }
    }

    #[test]
    fn paths_of_all_vessels_are_there() {
        let (config, track) = (CoastalConfig::default(), track());
        let starts = HeadOnStarts::find(std::slice::from_ref(&track), &config.head_on);
        assert!(!starts.straight_on.is_empty());
        let state = |start: crate::scenario::encounter_starts::HeadOnStart| {
            (track.positions[start.index], track.velocity(start.index))
        };
        let config = CoastalConfig { scenario: crate::env::coastal::ScenarioChoice::StraightOn, ..config };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let opening = Opening::draw(&config, &starts, 5.0, state, &mut rng).unwrap();
        let situation = Situation { opening: &opening, track: &track, episode: 0 };
        let mut forecaster = LinearForecaster::over(75);
        let product = make(&[situation], &config, &mut forecaster).unwrap();
        let count = |of: &str| product.data.rows().iter().filter(|row| row[1] == of.into()).count();
        assert_eq!(count("obstacle 1, observed"), 75);
        for series in ["obstacle 1, true", "obstacle 1, forecast", "own ship, holding course", "obstacle 4"] {
            assert_eq!(count(series), 61, "{series}");
        }
        assert!(product.to_svg().unwrap().contains("own ship now"));
        let pose = head_on_pose(track.positions[100], track.velocity(100), 8.0, 240.0);
        assert!(pose.position.is_finite());
    }

    #[test]
    fn the_closest_distance_is_found_between_samples() {
        let at = |north_m, east_m| Position { north_m, east_m };
        let (a, b) = ([at(0.0, -5.0), at(0.0, 5.0)], [at(3.0, 0.0), at(3.0, 0.0)]);
        assert!((closest_m(&a, &b) - 3.0).abs() < 1e-12);
    }
}
