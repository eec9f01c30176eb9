//! Who steers own ship: the [`Policy`] trait and the policies, one file each.
//!
//! Once per decision a policy sees the [`Situation`] as own ship's sensors give it and answers with a
//! [`Command`]. It knows nothing of how other vessels will move but what it infers from their past.
//! A new policy is one new file and one line of [`by_name`].

use std::fmt;

use crate::angle::Nautical;
use crate::geo::{Position, Velocity};
use crate::vessel::Command;

mod hold_course;
mod rule_based;
mod trained;

pub use crate::route::Route;
pub use hold_course::HoldCourse;
pub use rule_based::{RuleBased, RuleBasedConfig};
pub use trained::{TrainedPolicy, UnfitAgent};

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
    /// Where it is expected to go, one position per time step, the next one first; nothing where there is
    /// no forecast of it.
    pub forecast: Option<&'a [Position]>,
    /// The distance between centres that counts as contact with own ship, in metres.
    pub collision_distance_m: f64,
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

    /// Forgets the last episode. Whatever the policy draws at random follows from `seed`.
    fn reset(&mut self, seed: u64);

    /// The command for the time until the next decision.
    fn decide(&mut self, situation: &Situation<'_>) -> Command;
}

/// Names that [`by_name`] knows.
pub const NAMES: [&str; 2] = [hold_course::NAME, rule_based::NAME];

/// A policy with its default settings; nothing where no policy has that name.
#[must_use]
pub fn by_name(name: &str) -> Option<Box<dyn Policy>> {
    match name {
        hold_course::NAME => Some(Box::new(HoldCourse)),
        rule_based::NAME => Some(Box::new(RuleBased::new(RuleBasedConfig::default()))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_gives_the_policy_of_that_name() {
        for name in NAMES {
            assert_eq!(by_name(name).expect("a policy").name(), name);
        }
        assert!(by_name("full astern").is_none());
    }
}
