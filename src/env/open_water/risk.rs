//! Collision risk of the obstacles: forecast, backcast, closest point of approach, held in between.

use nalgebra::Vector2;

use super::OpenWaterConfig;
use super::field::{Agent, Field, Obstacle};
use crate::cpa::linear::closest_approach;
use crate::cpa::{Cpa, CpaConfig, Estimator, StraightMotion};
use crate::forecast::{Forecaster, Forecasts};
use crate::geo::Position;

/// Estimates of all obstacles and what they are made with.
pub struct RiskEstimates {
    forecaster: Box<dyn Forecaster>,
    estimator: Estimator,
    estimates: Vec<Cpa>,
    forecasts: Forecasts,
    due: Vec<usize>,
    histories: Vec<Vec<Position>>,
    row: Vec<Vector2<f64>>,
    fallbacks: u64,
}

impl RiskEstimates {
    /// Nothing estimated yet.
    #[must_use]
    pub fn new(config: &OpenWaterConfig, forecaster: Box<dyn Forecaster>) -> Self {
        let cpa =
            CpaConfig { method: config.cpa, smoothing: config.smoothing_half_width, ..CpaConfig::default() };
        Self {
            forecaster,
            estimator: Estimator::new(&cpa),
            estimates: vec![Cpa::UNKNOWN; 2 * config.obstacles_per_rule],
            forecasts: Forecasts::new(),
            due: Vec::new(),
            histories: Vec::new(),
            row: Vec::new(),
            fallbacks: 0,
        }
    }

    /// The estimate of each obstacle.
    #[must_use]
    pub fn estimates(&self) -> &[Cpa] {
        &self.estimates
    }

    /// Estimates so far that rest on a fallback: a solver that failed, or a straight line in place of
    /// a forecast.
    #[must_use]
    pub fn fallbacks(&self) -> u64 {
        self.fallbacks
    }

    /// Estimates all obstacles at every `estimate_every_steps`th step, those that have just appeared at
    /// once; the others are held, their time counted down.
    pub fn refresh(&mut self, field: &Field, config: &OpenWaterConfig) {
        let all_due = field.step().is_multiple_of(config.estimate_every_steps);
        self.due.clear();
        for (index, obstacle) in field.obstacles().iter().enumerate() {
            if all_due || obstacle.age_steps == 0 {
                self.due.push(index);
            } else {
                self.estimates[index].time_s -= config.dt_s;
            }
        }
        if !self.due.is_empty() {
            self.estimate_due(field, config);
        }
    }

    fn estimate_due(&mut self, field: &Field, config: &OpenWaterConfig) {
        let Self { due, histories, .. } = self;
        histories.resize_with(due.len(), Vec::new);
        for (history, &index) in histories.iter_mut().zip(due.iter()) {
            history.clear();
            history.extend(field.obstacles()[index].history().map(to_position));
        }
        let views: Vec<&[Position]> = histories.iter().map(Vec::as_slice).collect();
        let forecast = self.forecaster.forecast_both_ways(&views, config.forecast_steps, &mut self.forecasts);
        let count = due.len();
        for slot in 0..count {
            let index = self.due[slot];
            let obstacle = &field.obstacles()[index];
            self.estimates[index] = match forecast {
                Ok(()) => self.estimate(slot, count, field.agent(), config),
                // Ten finite positions always give a velocity; were there fewer, straight lines stand in.
                Err(_) => {
                    self.fallbacks += 1;
                    straight(field.agent(), obstacle)
                }
            };
        }
    }

    fn estimate(&mut self, slot: usize, count: usize, agent: &Agent, config: &OpenWaterConfig) -> Cpa {
        let history = &self.histories[slot];
        self.row.clear();
        self.row.extend(self.forecasts.path(count + slot).iter().rev().map(|position| position.xy()));
        let now = self.row.len() + history.len() - 1;
        self.row.extend(history.iter().map(|position| position.xy()));
        self.row.extend(self.forecasts.path(slot).iter().map(|position| position.xy()));
        let own = StraightMotion { position: agent.position, velocity: agent.velocity };
        let refined = self.estimator.estimate(own, self.row.iter().copied(), now, config.dt_s);
        self.fallbacks += refined.fallbacks as u64;
        refined.cpa
    }
}

/// The closed form on the linear parts.
fn straight(agent: &Agent, obstacle: &Obstacle) -> Cpa {
    closest_approach(agent.position, agent.velocity, obstacle.position(), obstacle.velocity)
}

/// The field's axes laid on the compass: the direction of travel is east, port is north.
pub fn to_position(point: Vector2<f64>) -> Position {
    Position { north_m: point.y, east_m: point.x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forecast::LinearForecaster;

    fn calm() -> OpenWaterConfig {
        let mut config = OpenWaterConfig::default();
        config.stochastic.innovation_sd_m = 0.0;
        config
    }

    fn estimates(config: &OpenWaterConfig) -> RiskEstimates {
        RiskEstimates::new(config, Box::new(LinearForecaster::over(10)))
    }

    /// On straight lines the smoothed estimate and the closed form agree but for the smoothing, which
    /// vanishes far from the closest point.
    #[test]
    fn straight_obstacles_are_estimated_as_the_closed_form_does() {
        let config = OpenWaterConfig { smoothing_half_width: 0, ..calm() };
        let field = Field::new(&config, 5);
        let mut risk = estimates(&config);
        risk.refresh(&field, &config);
        let reach_s = config.dt_s * config.forecast_steps as f64;
        let mut compared = 0;
        for (estimate, obstacle) in risk.estimates().iter().zip(field.obstacles()) {
            let exact = straight(field.agent(), obstacle);
            if exact.time_s.abs() < reach_s {
                assert!((estimate.distance_m - exact.distance_m).abs() < 1e-5, "{estimate:?} {exact:?}");
                compared += 1;
            }
        }
        assert!(compared >= 4, "{compared}");
        assert_eq!(risk.fallbacks(), 0);
    }

    #[test]
    fn estimates_are_held_and_counted_down_between_refreshes() {
        let config = calm();
        let mut field = Field::new(&config, 6);
        let mut risk = estimates(&config);
        risk.refresh(&field, &config);
        for step in 1..=30 {
            let before = risk.estimates().to_vec();
            field.advance(1.0);
            field.replace_passed();
            risk.refresh(&field, &config);
            for (index, obstacle) in field.obstacles().iter().enumerate() {
                let held = Cpa { time_s: before[index].time_s - 5.0, ..before[index] };
                let is_held = risk.estimates()[index] == held;
                assert_eq!(
                    is_held,
                    step % 10 != 0 && obstacle.age_steps != 0,
                    "step {step}, obstacle {index}"
                );
            }
        }
    }
}
