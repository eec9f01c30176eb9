//! What tests of policies share: an own ship that goes north from the origin at 8 m/s and is asked for a decision
//! every 20 s, among ships that keep to their motions.

use super::{OwnShip, Policy, Route, Situation, TargetShip};
use crate::angle::Nautical;
use crate::geo::{Position, Velocity};
use crate::vessel::{Command, Kinematic, KinematicConfig, Linear, Motion, Steered, VesselState};

pub(super) const DT_S: f64 = 5.0;
const SPEED_MPS: f64 = 8.0;
const STEPS_PER_DECISION: i64 = 4;
const FORECAST_STEPS: i64 = 200;

/// How own ship may be steered and what it is told.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ship {
    pub kinematic: KinematicConfig,
    /// Largest change of speed in one decision, in metres per second.
    pub max_speed_change_mps: f64,
    /// Whether the true future of the target ships serves as their forecast.
    pub foresees: bool,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sailed {
    /// Smallest distance of centres at the time steps, in metres.
    pub closest_m: f64,
    /// Cross-track error at every step, positive to port, in metres.
    pub cross_track_m: Vec<f64>,
    /// Speed at every step, in metres per second.
    pub speed_mps: Vec<f64>,
}

impl Sailed {
    pub fn last_cross_track_m(&self) -> f64 {
        self.cross_track_m.last().copied().unwrap_or(0.0)
    }

    pub fn most_to_port_m(&self) -> f64 {
        self.cross_track_m.iter().copied().fold(0.0, f64::max)
    }

    pub fn most_to_starboard_m(&self) -> f64 {
        self.cross_track_m.iter().map(|error| -error).fold(0.0, f64::max)
    }
}

/// Sails `steps` time steps among target ships; contact is at 300 m.
pub(super) fn sail(policy: &mut dyn Policy, ship: Ship, targets: &[&dyn Motion], steps: i64) -> Sailed {
    let route = Route::straight(Position::ORIGIN, Nautical::NORTH);
    let mut own = Kinematic::new(ship.kinematic, Position::ORIGIN, Nautical::NORTH, SPEED_MPS);
    let mut sailed = Sailed { closest_m: f64::INFINITY, cross_track_m: vec![], speed_mps: vec![] };
    policy.reset(0);
    for step in 0..steps {
        let state = own.state();
        if step % STEPS_PER_DECISION == 0 {
            let ahead: Vec<Vec<Position>> = targets
                .iter()
                .map(|target| (1..=FORECAST_STEPS).map(|k| target.position(step + k)).collect())
                .collect();
            let seen: Vec<_> = targets
                .iter()
                .zip(&ahead)
                .map(|(target, ahead)| TargetShip {
                    position: target.position(step),
                    velocity: target.state(step).velocity,
                    history: &[],
                    forecast: ship.foresees.then_some(ahead.as_slice()),
                    collision_distance_m: 300.0,
                })
                .collect();
            let command = policy.decide(&Situation {
                time_s: step as f64 * DT_S,
                dt_s: DT_S,
                decision_s: STEPS_PER_DECISION as f64 * DT_S,
                own: OwnShip {
                    position: state.position,
                    velocity: state.velocity,
                    heading: state.heading,
                    ordered_heading: own.ordered_heading(),
                    max_turn_rad: own.max_turn_rad(),
                    planned_speed_mps: SPEED_MPS,
                    max_speed_change_mps: ship.max_speed_change_mps,
                    history: &[],
                },
                route: &route,
                targets: &seen,
            });
            let present_mps = state.velocity.speed_mps();
            let within_reach = |speed_mps: f64| {
                speed_mps
                    .clamp(present_mps - ship.max_speed_change_mps, present_mps + ship.max_speed_change_mps)
            };
            own.order(Command { speed_mps: command.speed_mps.map(within_reach), ..command });
        }
        own.advance(DT_S);
        let VesselState { position, velocity, .. } = own.state();
        let nearest = targets.iter().map(|target| target.position(step + 1).distance_m(position));
        sailed.closest_m = nearest.fold(sailed.closest_m, f64::min);
        sailed.cross_track_m.push(route.cross_track_error_m(position));
        sailed.speed_mps.push(velocity.speed_mps());
    }
    sailed
}

/// A ship that would meet own ship after `tcpa_s`, on a course and at a speed.
pub(super) fn meeting(course_deg: f64, speed_mps: f64, tcpa_s: f64) -> Linear {
    let velocity = Velocity::from_course(Nautical::from_degrees(course_deg), speed_mps);
    let meeting = Position { north_m: SPEED_MPS * tcpa_s, east_m: 0.0 };
    Linear::new(meeting - velocity.for_seconds(tcpa_s), velocity, DT_S)
}
