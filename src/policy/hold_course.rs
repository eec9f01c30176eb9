//! Keeps course and speed, whatever comes.

use super::{Policy, Situation};
use crate::vessel::Command;

pub(super) const NAME: &str = "hold-course";

/// The policy that never gives an order: the measure of what an encounter does by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct HoldCourse;

impl Policy for HoldCourse {
    fn name(&self) -> &str {
        NAME
    }

    fn reset(&mut self, _seed: u64) {}

    fn decide(&mut self, _situation: &Situation<'_>) -> Command {
        Command::default()
    }
}
