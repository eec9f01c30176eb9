//! Turns to starboard when the closed-form DCPA and TCPA call for it, and comes back to its track.

use serde::{Deserialize, Serialize};

use super::{Policy, Situation, TargetShip};
use crate::angle::Nautical;
use crate::cpa::linear::closest_approach;
use crate::geo::Velocity;
use crate::vessel::Command;

pub(super) const NAME: &str = "rule-based";

/// Thresholds of the rule.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RuleBasedConfig {
    /// A DCPA under the collision distance plus this margin calls for a turn, in metres.
    pub margin_m: f64,
    /// A closest point of approach further off than this does not call for a turn yet, in seconds.
    pub horizon_s: f64,
    /// The largest turn away from the way back to the track, in degrees.
    pub max_deviation_deg: f64,
    /// Spacing of the headings that are tried, in degrees.
    pub heading_step_deg: f64,
    /// How far ahead on the track the way back aims, in metres.
    pub lookahead_m: f64,
}

impl Default for RuleBasedConfig {
    fn default() -> Self {
        Self {
            margin_m: 200.0,
            horizon_s: 600.0,
            max_deviation_deg: 90.0,
            heading_step_deg: 1.0,
            lookahead_m: 1000.0,
        }
    }
}

/// Steers the heading nearest to starboard of the way back to its track on which no target ship comes
/// too close, if all of them keep their velocity. Where no heading is clear it turns as far as it
/// may. It keeps its speed, and knows no stand-on vessel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RuleBased {
    config: RuleBasedConfig,
}

impl RuleBased {
    /// With thresholds of its own.
    #[must_use]
    pub fn new(config: RuleBasedConfig) -> Self {
        Self { config }
    }

    fn wanted_heading(&self, situation: &Situation<'_>) -> Nautical {
        let own = &situation.own;
        let back = situation.route.course_back(own.position, self.config.lookahead_m);
        let tries = (self.config.max_deviation_deg / self.config.heading_step_deg).max(0.0) as usize;
        (0..=tries)
            .map(|k| back.turned((k as f64 * self.config.heading_step_deg).to_radians()))
            .find(|heading| {
                !situation.targets.iter().any(|target| self.calls_for_a_turn(situation, *heading, target))
            })
            .unwrap_or(back.turned(self.config.max_deviation_deg.to_radians()))
    }

    fn calls_for_a_turn(
        &self,
        situation: &Situation<'_>,
        heading: Nautical,
        target: &TargetShip<'_>,
    ) -> bool {
        let own = &situation.own;
        let velocity = Velocity::from_course(heading, own.velocity.speed_mps());
        let cpa =
            closest_approach(own.position.xy(), velocity.xy(), target.position.xy(), target.velocity.xy());
        (0.0..=self.config.horizon_s).contains(&cpa.time_s)
            && cpa.distance_m < target.collision_distance_m + self.config.margin_m
    }
}

impl Policy for RuleBased {
    fn name(&self) -> &str {
        NAME
    }

    fn reset(&mut self, _seed: u64) {}

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let own = &situation.own;
        let turn_rad = self.wanted_heading(situation).turn_from(own.ordered_heading);
        Command { turn_rad: turn_rad.clamp(-own.max_turn_rad, own.max_turn_rad), speed_mps: None }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, Sailed, Ship, meeting, sail};
    use super::*;
    use crate::geo::Position;
    use crate::policy::HoldCourse;
    use crate::vessel::{Linear, Motion};

    fn run(policy: &mut dyn Policy, target: &dyn Motion, steps: i64) -> Sailed {
        sail(policy, Ship::default(), &[target], steps)
    }

    #[test]
    fn a_head_on_vessel_is_passed_clear_to_port_and_the_track_taken_up_again() {
        let head_on = meeting(180.0, 7.0, 240.0);
        assert!(run(&mut HoldCourse, &head_on, 60).closest_m < 50.0);
        let mut policy = RuleBased::new(RuleBasedConfig::default());
        let sailed = run(&mut policy, &head_on, 60);
        assert!(sailed.closest_m > 350.0 && sailed.most_to_port_m() < 1e-6, "{sailed:?}");
        assert!(run(&mut policy, &head_on, 720).last_cross_track_m().abs() < 20.0);
    }

    #[test]
    fn nothing_in_the_way_calls_for_nothing() {
        let abeam = Linear::new(
            Position { north_m: 0.0, east_m: 2000.0 },
            Velocity { north_mps: 8.0, east_mps: 0.0 },
            DT_S,
        );
        let sailed = run(&mut RuleBased::new(RuleBasedConfig::default()), &abeam, 200);
        assert!((sailed.closest_m - 2000.0).abs() < 1e-6);
        assert!(sailed.last_cross_track_m().abs() < 1e-6 && sailed.most_to_port_m() < 1e-6);
    }

    #[test]
    fn a_crossing_vessel_from_starboard_is_passed_astern() {
        let crossing = meeting(270.0, 6.0, 240.0);
        let mut policy = RuleBased::new(RuleBasedConfig::default());
        assert!(run(&mut HoldCourse, &crossing, 60).closest_m < 50.0);
        assert!(run(&mut policy, &crossing, 80).closest_m > 300.0);
    }
}
