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
    use super::*;
    use crate::geo::Position;
    use crate::policy::{HoldCourse, OwnShip, Route};
    use crate::vessel::{Kinematic, KinematicConfig, Linear, Motion, Steered};

    const DT_S: f64 = 5.0;

    /// Runs an encounter with linear target ships and returns the closest distance, the final
    /// cross-track error and the largest one to port, all in metres.
    fn run(policy: &mut dyn Policy, targets: &[Linear], steps: i64) -> (f64, f64, f64) {
        let route = Route::straight(Position::ORIGIN, Nautical::NORTH);
        let mut ship = Kinematic::new(KinematicConfig::default(), Position::ORIGIN, Nautical::NORTH, 8.0);
        let (mut closest_m, mut to_port_m) = (f64::INFINITY, 0.0_f64);
        policy.reset(0);
        for step in 0..steps {
            let state = ship.state();
            if step % 4 == 0 {
                let seen: Vec<_> = targets
                    .iter()
                    .map(|target| TargetShip {
                        position: target.position(step),
                        velocity: target.velocity(),
                        history: &[],
                        forecast: None,
                        collision_distance_m: 300.0,
                    })
                    .collect();
                let own = OwnShip {
                    position: state.position,
                    velocity: state.velocity,
                    heading: state.heading,
                    ordered_heading: ship.ordered_heading(),
                    max_turn_rad: ship.max_turn_rad(),
                    history: &[],
                };
                let time_s = step as f64 * DT_S;
                ship.order(policy.decide(&Situation {
                    time_s,
                    dt_s: DT_S,
                    decision_s: 20.0,
                    own,
                    route: &route,
                    targets: &seen,
                }));
            }
            ship.advance(DT_S);
            let position = ship.state().position;
            let nearest = targets.iter().map(|target| target.position(step + 1).distance_m(position));
            closest_m = nearest.fold(closest_m, f64::min);
            to_port_m = to_port_m.max(route.cross_track_error_m(position));
        }
        (closest_m, route.cross_track_error_m(ship.state().position), to_port_m)
    }

    fn head_on() -> Linear {
        let velocity = Velocity::from_course(Nautical::from_degrees(180.0), 7.0);
        Linear::new(Position { north_m: 240.0 * 15.0, east_m: 0.0 }, velocity, DT_S)
    }

    #[test]
    fn a_head_on_vessel_is_passed_clear_to_port_and_the_track_taken_up_again() {
        let (held_m, ..) = run(&mut HoldCourse, &[head_on()], 60);
        assert!(held_m < 50.0, "{held_m}");
        let mut policy = RuleBased::new(RuleBasedConfig::default());
        let (closest_m, _, to_port_m) = run(&mut policy, &[head_on()], 60);
        assert!(closest_m > 350.0 && to_port_m < 1e-6, "{closest_m} {to_port_m}");
        let (_, cross_track_m, _) = run(&mut policy, &[head_on()], 720);
        assert!(cross_track_m.abs() < 20.0, "{cross_track_m}");
    }

    #[test]
    fn nothing_in_the_way_calls_for_nothing() {
        let abeam = Linear::new(
            Position { north_m: 0.0, east_m: 2000.0 },
            Velocity { north_mps: 8.0, east_mps: 0.0 },
            DT_S,
        );
        let mut policy = RuleBased::new(RuleBasedConfig::default());
        let (closest_m, cross_track_m, to_port_m) = run(&mut policy, &[abeam], 200);
        assert!((closest_m - 2000.0).abs() < 1e-6 && cross_track_m.abs() < 1e-6 && to_port_m < 1e-6);
    }

    #[test]
    fn a_crossing_vessel_from_starboard_is_passed_astern() {
        let crossing = Linear::new(
            Position { north_m: 240.0 * 8.0, east_m: 240.0 * 6.0 },
            Velocity { north_mps: 0.0, east_mps: -6.0 },
            DT_S,
        );
        let mut policy = RuleBased::new(RuleBasedConfig::default());
        let (held_m, ..) = run(&mut HoldCourse, &[crossing], 60);
        let (closest_m, ..) = run(&mut policy, &[crossing], 80);
        assert!(held_m < 50.0 && closest_m > 300.0, "{held_m} {closest_m}");
    }
}
