//! Who steers own ship: the [`Policy`] trait and the policies, one file each.
//!
//! Once per decision a policy sees the [`Situation`] as own ship's sensors give it and answers with a
//! [`Command`]. It knows nothing of how other vessels will move but what it infers from their past,
//! and the forecasts that a [`TargetShip`] may bring.
//! A new policy is one new file and one line of [`by_name`].

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::angle::Nautical;
use crate::config::bounds::POSITIVE;
use crate::config::{Fault, check_bounds};
use crate::geo::{Position, Velocity};
use crate::vessel::Command;

mod duties;
mod full_turn;
mod hold_course;
mod outlook;
mod potential_field;
mod predictive;
mod rule_based;
mod trained;
mod velocity_obstacle;

pub use crate::route::Route;
pub use duties::DutiesConfig;
pub use full_turn::FullTurn;
pub use hold_course::HoldCourse;
pub use potential_field::{PotentialField, PotentialFieldConfig};
pub use predictive::{PredictiveConfig, PredictiveControl};
pub use rule_based::{RuleBased, RuleBasedConfig};
pub use trained::{TrainedPolicy, UnfitAgent};
pub use velocity_obstacle::{VelocityObstacle, VelocityObstacleConfig};

/// Own ship at a decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnShip<'a> {
    /// Position as sensed.
    pub position: Position,
    /// Velocity over ground.
    pub velocity: Velocity,
    /// Direction of the bow.
    pub heading: Nautical,
    /// The heading last ordered, which a command's turn is counted from.
    pub ordered_heading: Nautical,
    /// The largest turn of one command, in radians.
    pub max_turn_rad: f64,
    /// The speed it would make if nothing were in its way, in metres per second.
    pub planned_speed_mps: f64,
    /// The largest change of speed of one command, in metres per second; 0 where its speed is constant.
    pub max_speed_change_mps: f64,
    /// The latest positions as sensed, one per time step, oldest first, the present one last.
    pub history: &'a [Position],
}

/// A target ship at a decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetShip<'a> {
    /// Position as sensed.
    pub position: Position,
    /// Velocity over ground.
    pub velocity: Velocity,
    /// The latest positions as sensed, one per time step, oldest first, the present one last.
    pub history: &'a [Position],
    /// Where it is expected at the coming time steps, the next one first; nothing where no forecaster
    /// serves, so that it is expected to keep its velocity.
    pub forecast: Option<&'a [Position]>,
    /// The distance between centres that counts as contact with own ship, in metres.
    pub collision_distance_m: f64,
}

impl TargetShip<'_> {
    /// Where it is expected `time_s` from now (not negative), in a plane with steps of `dt_s`: on the
    /// straight lines between forecast positions, and beyond the last of them on the last line; without
    /// a forecast, at its present velocity.
    #[must_use]
    pub fn expected(&self, time_s: f64, dt_s: f64) -> Position {
        let Some(forecast) = self.forecast.filter(|forecast| !forecast.is_empty()) else {
            return self.position + self.velocity.for_seconds(time_s);
        };
        let steps = time_s / dt_s;
        // Forecast position `i` belongs to step `i + 1`; the present one opens the first line.
        let end = (steps.floor() as usize).min(forecast.len() - 1);
        let begin = if end == 0 { self.position } else { forecast[end - 1] };
        begin.lerp(forecast[end], steps - end as f64)
    }
}

/// What a policy decides on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation<'a> {
    /// Seconds since the start.
    pub time_s: f64,
    /// Time between two steps, and so between two positions of a history, in seconds.
    pub dt_s: f64,
    /// Time until the next decision, in seconds.
    pub decision_s: f64,
    /// Own ship.
    pub own: OwnShip<'a>,
    /// Where own ship wants to go.
    pub route: &'a Route,
    /// All the others.
    pub targets: &'a [TargetShip<'a>],
}

/// A policy: from what own ship knows to what it does.
pub trait Policy: fmt::Debug + Send {
    /// What it is called on the command line and in tables.
    fn name(&self) -> &str;

    /// Time between two of its decisions, in seconds, where it has a pace of its own: it is then asked that often, which
    /// has to be a multiple of the interval at which own ship takes orders. Nothing where it is asked each time.
    fn decision_interval_s(&self) -> Option<f64> {
        None
    }

    /// Forgets the last episode. Whatever the policy draws at random follows from `seed`.
    fn reset(&mut self, seed: u64);

    /// The command for the time until the next decision.
    fn decide(&mut self, situation: &Situation<'_>) -> Command;
}

/// Names that [`by_name`] knows.
pub const NAMES: [&str; 7] = [
    hold_course::NAME,
    full_turn::STARBOARD,
    full_turn::PORT,
    rule_based::NAME,
    velocity_obstacle::NAME,
    potential_field::NAME,
    predictive::NAME,
];

/// A policy with its default settings; nothing where no policy has that name.
#[must_use]
pub fn by_name(name: &str) -> Option<Box<dyn Policy>> {
    PolicyConfigs::default().policy(name)
}

/// Settings of every policy that has any: a file with one table per policy, named like it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct PolicyConfigs {
    /// Settings of `rule-based`.
    pub rule_based: RuleBasedConfig,
    /// Settings of `velocity-obstacle`.
    pub velocity_obstacle: VelocityObstacleConfig,
    /// Settings of `potential-field`.
    pub potential_field: PotentialFieldConfig,
    /// Settings of `mpc`.
    pub mpc: PredictiveConfig,
}

impl PolicyConfigs {
    /// A policy with these settings; nothing where no policy has that name.
    #[must_use]
    pub fn policy(&self, name: &str) -> Option<Box<dyn Policy>> {
        Some(match name {
            hold_course::NAME => Box::new(HoldCourse),
            full_turn::STARBOARD => Box::new(FullTurn::Starboard),
            full_turn::PORT => Box::new(FullTurn::Port),
            rule_based::NAME => Box::new(RuleBased::new(self.rule_based)),
            velocity_obstacle::NAME => Box::new(VelocityObstacle::new(self.velocity_obstacle.clone())),
            potential_field::NAME => Box::new(PotentialField::new(self.potential_field)),
            predictive::NAME => Box::new(PredictiveControl::new(self.mpc.clone())),
            _ => return None,
        })
    }

    /// Checks that every value can be worked with.
    ///
    /// # Errors
    /// The first key whose value cannot be, and what to write instead.
    pub fn check(&self) -> Result<(), Fault> {
        let Self { rule_based, velocity_obstacle: vo, potential_field: field, mpc } = self;
        let positive = [
            ("rule-based.heading_step_deg", rule_based.heading_step_deg),
            ("rule-based.lookahead_m", rule_based.lookahead_m),
            ("velocity-obstacle.heading_step_deg", vo.heading_step_deg),
            ("velocity-obstacle.horizon_s", vo.horizon_s),
            ("velocity-obstacle.lookahead_m", vo.lookahead_m),
            ("potential-field.horizon_s", field.horizon_s),
            ("potential-field.lookahead_m", field.lookahead_m),
            ("mpc.heading_step_deg", mpc.heading_step_deg),
            ("mpc.horizon_s", mpc.horizon_s),
            ("mpc.near_time_s", mpc.near_time_s),
            ("mpc.lookahead_m", mpc.lookahead_m),
        ];
        let costs = [
            ("velocity-obstacle.speed_cost", vo.speed_cost),
            ("velocity-obstacle.port_cost", vo.port_cost),
            ("mpc.collision_cost", mpc.collision_cost),
            ("mpc.rule_cost", mpc.rule_cost),
            ("mpc.speed_cost", mpc.speed_cost),
            ("mpc.heading_cost", mpc.heading_cost),
            ("mpc.port_cost", mpc.port_cost),
            ("mpc.change_cost", mpc.change_cost),
        ];
        check_bounds(positive.map(|(key, value)| (key, value, POSITIVE)))?;
        check_bounds(costs.map(|(key, value)| (key, value, [0.0, 1e9])))?;
        let speeds = [
            ("velocity-obstacle.speed_fractions", &vo.speed_fractions),
            ("mpc.speed_fractions", &mpc.speed_fractions),
        ];
        let is_fraction = |fraction: &f64| (0.0..=1.0).contains(fraction);
        match speeds.into_iter().find(|(_, list)| list.is_empty() || !list.iter().all(is_fraction)) {
            Some((key, _)) => Err(Fault::new(key, "is no list of fractions", "write numbers from 0 to 1")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
