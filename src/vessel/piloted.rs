//! A steered vessel that follows waypoints of its own: how a target ship gets real dynamics.

use serde::{Deserialize, Serialize};

use super::{Command, Motion, Steered, VesselState, Waypoint};
use crate::angle::Nautical;
use crate::geo::{Displacement, Position, Velocity};

/// The states of a steered vessel, run through beforehand.
///
/// Before the start, and after the last step that was run, it goes straight on with its velocity
/// there.
#[derive(Debug, Clone, PartialEq)]
pub struct Piloted {
    states: Vec<VesselState>,
    dt_s: f64,
}

impl Piloted {
    /// Runs a vessel for `steps` steps, asking `pilot` for a command before each.
    pub fn new(
        mut ship: Box<dyn Steered>,
        dt_s: f64,
        steps: usize,
        mut pilot: impl FnMut(&dyn Steered) -> Command,
    ) -> Self {
        let mut states = vec![ship.state()];
        for _ in 0..steps {
            let command = pilot(ship.as_ref());
            ship.order(command);
            ship.advance(dt_s);
            states.push(ship.state());
        }
        Self { states, dt_s }
    }

    /// The nearest state that was run, and the way made from there to `step`.
    fn extrapolated(&self, step: i64) -> (&VesselState, Displacement) {
        let nearest = step.clamp(0, self.states.len() as i64 - 1);
        let state = &self.states[nearest as usize];
        (state, state.velocity.for_seconds((step - nearest) as f64 * self.dt_s))
    }
}

impl Motion for Piloted {
    fn position(&self, step: i64) -> Position {
        let (state, way) = self.extrapolated(step);
        state.position + way
    }

    fn state(&self, step: i64) -> VesselState {
        let (state, way) = self.extrapolated(step);
        VesselState { position: state.position + way, ..*state }
    }
}

/// How a pilot takes a ship along its waypoints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PilotConfig {
    /// How far ahead on the leg the ship aims, over its length.
    pub lookahead_over_length: f64,
    /// How far from a waypoint the next leg is taken up, over the ship's length.
    pub acceptance_over_length: f64,
    /// The largest change of the ordered heading in one time step, in degrees.
    pub max_turn_deg: f64,
}

impl Default for PilotConfig {
    fn default() -> Self {
        Self { lookahead_over_length: 5.0, acceptance_over_length: 2.0, max_turn_deg: 90.0 }
    }
}

/// Line-of-sight guidance from waypoint to waypoint (Fossen, *Handbook of Marine Craft Hydrodynamics
/// and Motion Control*, 2011, section 10.3).
///
/// The ship aims at the point of the present leg that lies a fixed distance beyond the one nearest to
/// it. The next leg is taken up within the circle of acceptance of its waypoint, or when that has come
/// abeam. Speeds are over ground: in a current, heading and speed through the water are ordered so that
/// both together make the course and the speed that are wanted.
#[derive(Debug, Clone)]
pub struct Pilot {
    waypoints: Vec<Waypoint>,
    leg: usize,
    lookahead_m: f64,
    acceptance_m: f64,
    current: Velocity,
}

impl Pilot {
    /// Along `waypoints` (two at least), with a ship of a length, in a current.
    #[must_use]
    pub fn new(waypoints: Vec<Waypoint>, length_m: f64, current: Velocity, config: &PilotConfig) -> Self {
        Self {
            waypoints,
            leg: 0,
            lookahead_m: config.lookahead_over_length * length_m,
            acceptance_m: config.acceptance_over_length * length_m,
            current,
        }
    }

    /// Where a leg begins and its course. The last one goes on without end.
    fn leg(&self, leg: usize) -> (Position, Nautical) {
        let (begin, end) = (self.waypoints[leg].position, self.waypoints[leg + 1].position);
        (begin, (end - begin).bearing())
    }

    /// The command that takes a ship on from where it is.
    pub fn command(&mut self, ship: &dyn Steered) -> Command {
        let position = ship.state().position;
        while self.leg + 2 < self.waypoints.len() && self.is_past(position) {
            self.leg += 1;
        }
        let (begin, course) = self.leg(self.leg);
        let ahead_m = (position - begin).along_m(course) + self.lookahead_m;
        let wanted = (begin + Displacement::towards(course, ahead_m) - position).bearing();
        // Beyond the last waypoint its own speed holds.
        let is_beyond = self.leg + 2 == self.waypoints.len() && self.is_past(position);
        let speed_mps = self.waypoints[if is_beyond { self.leg + 1 } else { self.leg }].speed_mps;
        let over_ground = Velocity::from_course(wanted, speed_mps);
        let through_water = over_ground - self.current;
        Command {
            turn_rad: through_water.course().turn_from(ship.ordered_heading()),
            speed_mps: Some(through_water.speed_mps()),
        }
    }

    /// Whether the waypoint at the end of the present leg is reached.
    fn is_past(&self, position: Position) -> bool {
        let end = self.waypoints[self.leg + 1].position;
        let (_, course) = self.leg(self.leg);
        position.distance_m(end) <= self.acceptance_m || (position - end).along_m(course) >= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::route::Route;
    use crate::vessel::mmg::Surroundings;
    use crate::vessel::{Dynamics, DynamicsConfig, Kinematic, KinematicConfig, Launch};

    fn waypoints(points: &[(f64, f64, f64)]) -> Vec<Waypoint> {
        let waypoint = |&(north_m, east_m, speed_mps): &(f64, f64, f64)| Waypoint {
            position: Position { north_m, east_m },
            speed_mps,
        };
        points.iter().map(waypoint).collect()
    }

    /// KVLCC2 from the first waypoint on, and the route that it is to follow.
    fn tanker(points: &[(f64, f64, f64)], current: Velocity, steps: usize) -> (Piloted, Route) {
        let waypoints = waypoints(points);
        let positions: Vec<Position> = waypoints.iter().map(|waypoint| waypoint.position).collect();
        let course = (positions[1] - positions[0]).bearing();
        let config = PilotConfig::default();
        let launch = Launch {
            position: positions[0],
            velocity: Velocity::from_course(course, waypoints[0].speed_mps),
            limits: KinematicConfig { max_turn_deg: config.max_turn_deg },
        };
        let dynamics = DynamicsConfig { dynamics: Dynamics::Kvlcc2, ..DynamicsConfig::default() };
        let ship = dynamics.launch(&launch, Surroundings { current, wind: None });
        let mut pilot = Pilot::new(waypoints, 320.0, current, &config);
        let motion = Piloted::new(ship, 5.0, steps, |ship| pilot.command(ship));
        (motion, Route::through(&positions).expect("a route"))
    }

    const STILL: Velocity = Velocity { north_mps: 0.0, east_mps: 0.0 };

    #[test]
    fn a_tanker_gets_round_the_corner_of_its_route() {
        let corner = [(0.0, 0.0, 7.0), (6000.0, 0.0, 7.0), (6000.0, 12_000.0, 7.0)];
        let (motion, route) = tanker(&corner, STILL, 480);
        let end = motion.state(480);
        assert!(route.cross_track_error_m(end.position).abs() < 50.0, "{end:?}");
        assert!(end.position.east_m > 6000.0 && (end.heading.degrees() - 90.0).abs() < 3.0, "{end:?}");
        // It cuts the corner, but by less than two lengths.
        let widest = (0..=480).map(|step| route.cross_track_error_m(motion.position(step)).abs());
        assert!(widest.fold(0.0, f64::max) < 640.0);
    }

    /// A hairpin: the way back runs close beside the way out, and may not be taken for it.
    #[test]
    fn legs_are_sailed_in_their_order_each_at_its_speed() {
        let hairpin = [(0.0, 0.0, 7.0), (8000.0, 0.0, 4.0), (8000.0, 800.0, 4.0), (5000.0, 800.0, 6.0)];
        let (motion, _) = tanker(&hairpin, STILL, 900);
        let furthest = (0..=720).map(|step| motion.position(step).north_m).fold(0.0, f64::max);
        assert!((7200.0..9500.0).contains(&furthest), "{furthest}");
        let (out, back, beyond) = (motion.state(120), motion.state(560), motion.state(900));
        assert!((out.velocity.speed_mps() - 7.0).abs() < 0.1, "{out:?}");
        // A laden tanker slows down over miles.
        assert!((3.9..5.5).contains(&back.velocity.speed_mps()), "{back:?}");
        assert!(beyond.velocity.speed_mps() > back.velocity.speed_mps() + 0.5, "{beyond:?}");
        assert!((back.position.east_m - 800.0).abs() < 50.0, "{back:?}");
        assert!((back.heading.degrees() - 180.0).abs() < 3.0 && back.position.north_m < 7500.0, "{back:?}");
    }

    #[test]
    fn a_current_across_the_route_is_headed_against() {
        let across = Velocity { north_mps: 0.0, east_mps: 1.5 };
        let (motion, route) = tanker(&[(0.0, 0.0, 6.0), (9000.0, 0.0, 6.0)], across, 240);
        let end = motion.state(240);
        assert!(route.cross_track_error_m(end.position).abs() < 1.0, "{end:?}");
        assert!((end.velocity.speed_mps() - 6.0).abs() < 0.06, "{end:?}");
        let crab_deg = -(1.5_f64 / 6.0).atan().to_degrees();
        assert!((end.heading.turn_from(Nautical::NORTH).to_degrees() - crab_deg).abs() < 0.5, "{end:?}");
    }

    #[test]
    fn outside_its_run_it_goes_straight_on() {
        let ship = Kinematic::new(KinematicConfig::default(), Position::ORIGIN, Nautical::NORTH, 8.0);
        let turn = Command { turn_rad: 0.01, speed_mps: None };
        let motion = Piloted::new(Box::new(ship), 5.0, 2, |_| turn);
        assert_eq!(motion.position(-3), Position { north_m: -120.0, east_m: 0.0 });
        assert_eq!(motion.state(9).heading, motion.state(2).heading);
        let beyond = motion.position(3) - motion.position(2);
        assert!((beyond.length_m() - 40.0).abs() < 1e-9);
    }
}
