//! Turns as far as it may at every decision, whatever comes.

use super::{Policy, Situation};
use crate::vessel::Command;

pub(super) const STARBOARD: &str = "full-starboard";
pub(super) const PORT: &str = "full-port";

/// The policy that always turns to one side: the measure of what a turn brings by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FullTurn {
    /// To starboard.
    Starboard,
    /// To port.
    Port,
}

impl Policy for FullTurn {
    fn name(&self) -> &str {
        match self {
            Self::Starboard => STARBOARD,
            Self::Port => PORT,
        }
    }

    fn reset(&mut self, _seed: u64) {}

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let turn_rad = match self {
            Self::Starboard => situation.own.max_turn_rad,
            Self::Port => -situation.own.max_turn_rad,
        };
        Command { turn_rad, speed_mps: None }
    }
}
