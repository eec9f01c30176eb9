//! Where a vessel wants to go: legs between waypoints, the outer ones without end.

use crate::angle::Nautical;
use crate::geo::{Displacement, Position};

#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    begin: Position,
    course: Nautical,
    length_m: f64,
    speed_mps: Option<f64>,
}

/// A planned path.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    legs: Vec<Leg>,
}

impl Route {
    /// One straight line through `begin`.
    #[must_use]
    pub fn straight(begin: Position, course: Nautical) -> Self {
        Self { legs: vec![Leg { begin, course, length_m: f64::INFINITY, speed_mps: None }] }
    }

    /// From waypoint to waypoint; beyond the last one the last course goes on. Nothing where fewer
    /// than two waypoints lie apart from each other.
    #[must_use]
    pub fn through(waypoints: &[Position]) -> Option<Self> {
        let unhurried: Vec<_> = waypoints.iter().map(|position| (*position, None)).collect();
        Self::planned(&unhurried)
    }

    /// As [`Self::through`], with the speed that is planned from a waypoint on, in metres per second;
    /// as on the leg before where it is not given.
    #[must_use]
    pub fn planned(waypoints: &[(Position, Option<f64>)]) -> Option<Self> {
        let mut planned_mps = None;
        let mut legs = Vec::with_capacity(waypoints.len());
        for ends in waypoints.windows(2) {
            let [(begin, speed_mps), (end, _)] = [ends[0], ends[1]];
            planned_mps = speed_mps.or(planned_mps);
            let way = end - begin;
            let length_m = way.length_m();
            if length_m > 0.0 {
                legs.push(Leg { begin, course: way.bearing(), length_m, speed_mps: planned_mps });
            }
        }
        legs.last_mut()?.length_m = f64::INFINITY;
        Some(Self { legs })
    }

    /// The speed that is planned where the route is nearest to a position, in metres per second; nothing
    /// where none is.
    #[must_use]
    pub fn speed_mps(&self, position: Position) -> Option<f64> {
        self.legs[self.nearest(position).0].speed_mps
    }

    /// Cross-track error of a position, in metres: its distance from the route, positive to **port**.
    #[must_use]
    pub fn cross_track_error_m(&self, position: Position) -> f64 {
        let leg = self.legs[self.nearest(position).0];
        -(position - leg.begin).starboard_of_m(leg.course)
    }

    /// Course of the route where it is nearest to a position.
    #[must_use]
    pub fn course(&self, position: Position) -> Nautical {
        self.legs[self.nearest(position).0].course
    }

    /// The course from a position to the point of the route that lies `lookahead_m` beyond the
    /// nearest one: line-of-sight guidance (Fossen, Handbook of Marine Craft Hydrodynamics and
    /// Motion Control, section 12.3).
    #[must_use]
    pub fn course_back(&self, position: Position, lookahead_m: f64) -> Nautical {
        let (mut index, along_m) = self.nearest(position);
        let mut ahead_m = along_m + lookahead_m;
        while ahead_m > self.legs[index].length_m {
            ahead_m -= self.legs[index].length_m;
            index += 1;
        }
        let leg = self.legs[index];
        (leg.begin + Displacement::towards(leg.course, ahead_m) - position).bearing()
    }

    /// Index of the nearest leg and how far along it the foot of the perpendicular lies. Only the first leg
    /// reaches back beyond its beginning.
    fn nearest(&self, position: Position) -> (usize, f64) {
        let mut nearest = (0, 0.0);
        let mut least_m = f64::INFINITY;
        for (index, leg) in self.legs.iter().enumerate() {
            let from_begin = position - leg.begin;
            let floor_m = if index == 0 { f64::NEG_INFINITY } else { 0.0 };
            let along_m = from_begin.along_m(leg.course).clamp(floor_m, leg.length_m);
            let distance_m = (from_begin + -Displacement::towards(leg.course, along_m)).length_m();
            if distance_m < least_m {
                (nearest, least_m) = ((index, along_m), distance_m);
            }
        }
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(north_m: f64, east_m: f64) -> Position {
        Position { north_m, east_m }
    }

    #[test]
    fn port_of_the_route_is_positive() {
        let route = Route::straight(at(100.0, 0.0), Nautical::NORTH);
        assert!((route.cross_track_error_m(at(-500.0, -30.0)) - 30.0).abs() < 1e-9);
        assert!((route.cross_track_error_m(at(500.0, 30.0)) + 30.0).abs() < 1e-9);
    }

    #[test]
    fn guidance_leads_back_and_round_the_corner() {
        let route = Route::through(&[at(0.0, 0.0), at(1000.0, 0.0), at(1000.0, 1000.0)]).expect("a route");
        assert!((route.course_back(at(100.0, 300.0), 300.0).degrees() - 315.0).abs() < 1e-9);
        assert!((route.course_back(at(900.0, 0.0), 200.0).degrees() - 45.0).abs() < 1e-9);
        assert_eq!(route.course(at(1100.0, 500.0)).degrees().round(), 90.0);
        assert!((route.cross_track_error_m(at(1100.0, 500.0)) - 100.0).abs() < 1e-9);
        assert!((route.course_back(at(1000.0, 5000.0), 200.0).degrees() - 90.0).abs() < 1e-9);
    }

    #[test]
    fn a_planned_speed_holds_until_the_next() {
        let waypoints = [(0.0, None), (1000.0, Some(4.0)), (2000.0, None), (3000.0, Some(9.0))];
        let waypoints = waypoints.map(|(north_m, speed_mps)| (at(north_m, 0.0), speed_mps));
        let route = Route::planned(&waypoints).expect("a route");
        let planned = [500.0, 1500.0, 2500.0, 9000.0].map(|north_m| route.speed_mps(at(north_m, 10.0)));
        assert_eq!(planned, [None, Some(4.0), Some(4.0), Some(4.0)]);
    }

    #[test]
    fn waypoints_in_one_place_are_no_route() {
        assert_eq!(Route::through(&[at(1.0, 1.0), at(1.0, 1.0)]), None);
        assert_eq!(Route::through(&[at(1.0, 1.0)]), None);
    }
}
