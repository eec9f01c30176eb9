//! From waypoint to waypoint, with a speed for every leg.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Motion, VesselState};
use crate::geo::{Position, Velocity};

/// A point of a route and the speed on the leg that leaves it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// Where it lies.
    pub position: Position,
    /// Speed over ground on the leg from here, in metres per second; the last waypoint's is that of
    /// the way beyond the route.
    pub speed_mps: f64,
}

/// Why a list of waypoints is no route.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum WaypointsError {
    /// Fewer than two waypoints.
    #[error("a route needs two waypoints at least, this one has {0}: add the missing ones")]
    TooFew(usize),
    /// A speed that would never reach the next waypoint.
    #[error("the speed at waypoint {0} must be a number above 0 m/s: correct it")]
    Speed(usize),
    /// Two waypoints in one place, or a place that is not a number.
    #[error("waypoint {0} must lie apart from the one before it, at finite coordinates: move or remove it")]
    Place(usize),
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    begin: Position,
    begin_s: f64,
    velocity: Velocity,
}

/// Along a route at constant speed per leg, turning on the spot at waypoints.
///
/// At step 0 the vessel is at the first waypoint. It came from astern on the first leg's course and
/// speed, and goes on beyond the last waypoint on the last leg's course.
#[derive(Debug, Clone, PartialEq)]
pub struct Waypoints {
    legs: Vec<Leg>,
    dt_s: f64,
}

impl Waypoints {
    /// A route from its waypoints and the time between two steps.
    ///
    /// # Errors
    /// Fewer than two waypoints, two in one place, a speed that is not above zero. Waypoints are
    /// counted from 1.
    pub fn new(waypoints: &[Waypoint], dt_s: f64) -> Result<Self, WaypointsError> {
        if waypoints.len() < 2 {
            return Err(WaypointsError::TooFew(waypoints.len()));
        }
        let mut legs = Vec::with_capacity(waypoints.len());
        let mut begin_s = 0.0;
        for (index, waypoint) in waypoints.iter().enumerate() {
            if !(waypoint.speed_mps > 0.0 && waypoint.speed_mps.is_finite()) {
                return Err(WaypointsError::Speed(index + 1));
            }
            // The way beyond the last waypoint keeps the course of the last leg.
            let from = index.min(waypoints.len() - 2);
            let leg = waypoints[from + 1].position - waypoints[from].position;
            let length_m = leg.length_m();
            if !(length_m > 0.0 && length_m.is_finite()) {
                return Err(WaypointsError::Place(from + 2));
            }
            let velocity = Velocity::from_course(leg.bearing(), waypoint.speed_mps);
            legs.push(Leg { begin: waypoint.position, begin_s, velocity });
            begin_s += length_m / waypoint.speed_mps;
        }
        Ok(Self { legs, dt_s })
    }

    /// When the last waypoint is reached, in seconds from the start.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.legs.last().map_or(0.0, |leg| leg.begin_s)
    }

    fn leg_at(&self, time_s: f64) -> &Leg {
        let begun = self.legs.partition_point(|leg| leg.begin_s <= time_s);
        &self.legs[begun.saturating_sub(1)]
    }
}

impl Motion for Waypoints {
    fn position(&self, step: i64) -> Position {
        let time_s = step as f64 * self.dt_s;
        let leg = self.leg_at(time_s);
        leg.begin + leg.velocity.for_seconds(time_s - leg.begin_s)
    }

    fn state(&self, step: i64) -> VesselState {
        let velocity = self.leg_at(step as f64 * self.dt_s).velocity;
        VesselState { position: self.position(step), velocity, heading: velocity.course() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waypoint(north_m: f64, east_m: f64, speed_mps: f64) -> Waypoint {
        Waypoint { position: Position { north_m, east_m }, speed_mps }
    }

    #[test]
    fn every_leg_has_its_speed() {
        let route = [waypoint(0.0, 0.0, 4.0), waypoint(100.0, 0.0, 10.0), waypoint(100.0, 100.0, 2.0)];
        let motion = Waypoints::new(&route, 5.0).expect("a route");
        assert_eq!(motion.duration_s(), 35.0);
        assert!(motion.position(-1).distance_m(Position { north_m: -20.0, east_m: 0.0 }) < 1e-9);
        assert!(motion.position(6).distance_m(Position { north_m: 100.0, east_m: 50.0 }) < 1e-9);
        assert!(motion.position(8).distance_m(Position { north_m: 100.0, east_m: 110.0 }) < 1e-9);
        assert_eq!(motion.state(5).heading.degrees().round(), 90.0);
        assert!((motion.state(9).velocity.speed_mps() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_route_is_refused() {
        let start = waypoint(0.0, 0.0, 4.0);
        assert_eq!(Waypoints::new(&[start], 5.0), Err(WaypointsError::TooFew(1)));
        let standing = [start, waypoint(10.0, 0.0, 0.0)];
        assert_eq!(Waypoints::new(&standing, 5.0), Err(WaypointsError::Speed(2)));
        let twice = [start, waypoint(10.0, 0.0, 1.0), waypoint(10.0, 0.0, 1.0)];
        assert_eq!(Waypoints::new(&twice, 5.0), Err(WaypointsError::Place(3)));
        let nowhere = [start, waypoint(f64::NAN, 0.0, 1.0)];
        assert_eq!(Waypoints::new(&nowhere, 5.0), Err(WaypointsError::Place(2)));
    }
}
