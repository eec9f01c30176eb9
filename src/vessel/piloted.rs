//! A steered vessel that follows a route of its own: how a target ship gets real dynamics.

use super::{Command, Motion, Steered, VesselState};
use crate::geo::{Displacement, Position};
use crate::route::Route;

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
    pub fn new<S: Steered>(
        mut ship: S,
        dt_s: f64,
        steps: usize,
        mut pilot: impl FnMut(&S) -> Command,
    ) -> Self {
        let mut states = vec![ship.state()];
        for _ in 0..steps {
            let command = pilot(&ship);
            ship.order(command);
            ship.advance(dt_s);
            states.push(ship.state());
        }
        Self { states, dt_s }
    }

    /// Runs a vessel for `steps` steps along a route, aiming `lookahead_m` ahead on it.
    pub fn along<S: Steered>(ship: S, route: &Route, lookahead_m: f64, dt_s: f64, steps: usize) -> Self {
        Self::new(ship, dt_s, steps, |ship| {
            let wanted = route.course_back(ship.state().position, lookahead_m);
            Command { turn_rad: wanted.turn_from(ship.ordered_heading()), speed_mps: None }
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;
    use crate::vessel::mmg::Surroundings;
    use crate::vessel::{Kinematic, KinematicConfig, MmgConfig, MmgShip};

    #[test]
    fn a_tanker_gets_round_the_corner_of_its_route() {
        let corner = [(0.0, 0.0), (6000.0, 0.0), (6000.0, 12_000.0)]
            .map(|(north_m, east_m)| Position { north_m, east_m });
        let route = Route::through(&corner).expect("a route");
        let ship = MmgShip::new(
            MmgConfig::default(),
            Surroundings::default(),
            Position::ORIGIN,
            Nautical::NORTH,
            7.0,
        );
        let motion = Piloted::along(ship, &route, 1600.0, 5.0, 480);
        let end = motion.state(480);
        assert!(route.cross_track_error_m(end.position).abs() < 50.0, "{end:?}");
        assert!(end.position.east_m > 6000.0 && (end.heading.degrees() - 90.0).abs() < 3.0, "{end:?}");
        // It cuts the corner, but by less than two lengths.
        let widest = (0..=480).map(|step| route.cross_track_error_m(motion.position(step)).abs());
        assert!(widest.fold(0.0, f64::max) < 640.0);
    }

    #[test]
    fn outside_its_run_it_goes_straight_on() {
        let ship = Kinematic::new(KinematicConfig::default(), Position::ORIGIN, Nautical::NORTH, 8.0);
        let motion = Piloted::new(ship, 5.0, 2, |_| Command { turn_rad: 0.01, speed_mps: None });
        assert_eq!(motion.position(-3), Position { north_m: -120.0, east_m: 0.0 });
        assert_eq!(motion.state(9).heading, motion.state(2).heading);
        let beyond = motion.position(3) - motion.position(2);
        assert!((beyond.length_m() - 40.0).abs() < 1e-9);
    }
}
