//! The outline of a hull: a convex polygon from length, beam and the shape of the bow.

use std::f64::consts::FRAC_PI_2;
use std::ops::RangeInclusive;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::minkowski;
use crate::geo::{Displacement, Position};
use crate::vessel::VesselState;

/// Lengths and beams of vessels, in metres.
const SIZES_M: RangeInclusive<f64> = 0.1..=1000.0;
/// Breadth of the transom over the beam, and where the sides reach full beam, as a fraction of the
/// length forward of the stern.
const TRANSOM: (f64, f64) = (0.8, 0.1);
/// Points on either side of the bow between shoulder and stem.
const BOW_POINTS: usize = 2;

/// The shape of a bow, seen from above: half the beam at a fraction `x` of the way from shoulder to
/// stem is `(1 - x^p)^(1/p)` of the full half-beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bow {
    /// Fine entrance over 40 % of the length (`p = 1.3`): ferries, warships, sailing yachts.
    Fine,
    /// Elliptic, over 25 % of the length (`p = 2`): container and general cargo ships.
    #[default]
    Normal,
    /// Bluff, over 12 % of the length (`p = 2.5`): tankers, bulk carriers, barges.
    Full,
}

impl Bow {
    /// Length from shoulder to stem over the length of the vessel, and the exponent `p`.
    fn form(self) -> (f64, f64) {
        match self {
            Self::Fine => (0.40, 1.3),
            Self::Normal => (0.25, 2.0),
            Self::Full => (0.12, 2.5),
        }
    }
}

/// Why there is no such hull.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HullError {
    /// A length or beam that no vessel has.
    #[error(
        "a hull needs a length and a beam of 0.1 to 1000 m, not {length_m} m by {beam_m} m: correct them"
    )]
    Size {
        /// The length given, in metres.
        length_m: f64,
        /// The beam given, in metres.
        beam_m: f64,
    },
    /// Length and beam the wrong way round.
    #[error("a hull {length_m} m long cannot be {beam_m} m wide: swap or correct length and beam")]
    Wide {
        /// The length given, in metres.
        length_m: f64,
        /// The beam given, in metres.
        beam_m: f64,
    },
}

/// A point of a hull, in the vessel's own axes from midship on the centre line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HullPoint {
    /// Metres towards the bow.
    pub forward_m: f64,
    /// Metres to starboard.
    pub starboard_m: f64,
}

/// A convex outline around midship.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    length_m: f64,
    beam_m: f64,
    radius_m: f64,
    points: Vec<HullPoint>,
    /// The same points in right-handed axes, x forward and y to port, counter-clockwise.
    pub(super) outline: Vec<Vector2<f64>>,
}

impl Hull {
    /// From length over all, beam and the shape of the bow.
    ///
    /// # Errors
    /// Where length or beam is not within 0.1 to 1000 m, or the beam exceeds the length.
    pub fn new(length_m: f64, beam_m: f64, bow: Bow) -> Result<Self, HullError> {
        if ![length_m, beam_m].iter().all(|size_m| SIZES_M.contains(size_m)) {
            return Err(HullError::Size { length_m, beam_m });
        }
        if beam_m > length_m {
            return Err(HullError::Wide { length_m, beam_m });
        }
        let port = port_side(length_m, beam_m, bow);
        let stem = HullPoint { forward_m: length_m / 2.0, starboard_m: 0.0 };
        // Counter-clockwise seen from above: up the starboard side, round the stem, down to port.
        let starboard = port.iter().map(|point| HullPoint { starboard_m: -point.starboard_m, ..*point });
        let points: Vec<_> = starboard.chain([stem]).chain(port.iter().rev().copied()).collect();
        let outline: Vec<_> = points.iter().map(|p| Vector2::new(p.forward_m, -p.starboard_m)).collect();
        let radius_m = outline.iter().map(|point| point.norm()).fold(0.0, f64::max);
        Ok(Self { length_m, beam_m, radius_m, points, outline })
    }

    /// Length over all, in metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Greatest beam, in metres.
    #[must_use]
    pub fn beam_m(&self) -> f64 {
        self.beam_m
    }

    /// Distance from midship to the farthest point, in metres.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The corners, counter-clockwise seen from above, starting at the starboard end of the transom.
    #[must_use]
    pub fn points(&self) -> &[HullPoint] {
        &self.points
    }

    /// The corners of the hull of a vessel in this state, in the same order.
    pub fn at(&self, state: &VesselState) -> impl Iterator<Item = Position> + '_ {
        let VesselState { position, heading, .. } = *state;
        self.points.iter().map(move |point| {
            position
                + Displacement::towards(heading, point.forward_m)
                + Displacement::towards(heading.turned(FRAC_PI_2), point.starboard_m)
        })
    }

    /// Distance between the hulls of two vessels in these states, in metres; zero where they overlap.
    #[must_use]
    pub fn distance_m(&self, state: &VesselState, other: &Self, other_state: &VesselState) -> f64 {
        let corners = |hull: &Self, state: &VesselState| -> Vec<_> {
            hull.at(state).map(|corner| corner.xy() - state.position.xy()).collect()
        };
        let mut difference = Vec::new();
        minkowski::difference(&corners(self, state), &corners(other, other_state), &mut difference);
        let between = other_state.position.xy() - state.position.xy();
        minkowski::separation(&difference, -between).distance_m
    }
}

/// The corners of the port side from transom to the last point before the stem.
fn port_side(length_m: f64, beam_m: f64, bow: Bow) -> Vec<HullPoint> {
    let at = |forward_m: f64, breadth: f64| HullPoint { forward_m, starboard_m: -breadth * beam_m / 2.0 };
    let (bow_length, exponent) = bow.form();
    let (transom_breadth, run) = TRANSOM;
    let shoulder_m = length_m * (0.5 - bow_length);
    let mut side =
        vec![at(-length_m / 2.0, transom_breadth), at(-length_m * (0.5 - run), 1.0), at(shoulder_m, 1.0)];
    side.extend((1..=BOW_POINTS).map(|k| {
        // Equal angles of the superellipse put the points where it bends.
        let angle = FRAC_PI_2 * k as f64 / (BOW_POINTS + 1) as f64;
        let along = angle.sin().powf(2.0 / exponent);
        at(shoulder_m + length_m * bow_length * along, angle.cos().powf(2.0 / exponent))
    }));
    side
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;

    #[test]
    fn a_hull_is_convex_counter_clockwise_and_to_size() {
        for bow in [Bow::Fine, Bow::Normal, Bow::Full] {
            let hull = Hull::new(180.0, 30.0, bow).expect("a hull");
            let corners = &hull.outline;
            for (index, corner) in corners.iter().enumerate() {
                let next = corners[(index + 1) % corners.len()];
                let after = corners[(index + 2) % corners.len()];
                assert!((next - corner).perp(&(after - next)) > 0.0, "{bow:?} at {index}");
            }
            let extent = |of: fn(&HullPoint) -> f64| {
                let values = hull.points().iter().map(of);
                values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
            };
            assert!((extent(|p| p.forward_m) - 180.0).abs() < 1e-9);
            assert!((extent(|p| p.starboard_m) - 30.0).abs() < 1e-9);
            assert!(hull.points()[0].starboard_m > 0.0 && hull.points()[0].forward_m == -90.0);
        }
    }

    #[test]
    fn the_bow_points_along_the_heading_and_starboard_lies_to_the_right() {
        let hull = Hull::new(100.0, 20.0, Bow::Normal).expect("a hull");
        let east = VesselState::on_course(Position::ORIGIN, Nautical::from_degrees(90.0), 5.0);
        let corners: Vec<_> = hull.at(&east).collect();
        let stem = corners.iter().map(|corner| corner.east_m).fold(f64::MIN, f64::max);
        assert!((stem - 50.0).abs() < 1e-9);
        // The first corner is the starboard end of the transom: west and south of midship.
        assert!((corners[0].east_m + 50.0).abs() < 1e-9 && (corners[0].north_m + 8.0).abs() < 1e-9);
    }

    #[test]
    fn hulls_side_by_side_are_their_gap_apart() {
        let hull = Hull::new(100.0, 20.0, Bow::Full).expect("a hull");
        let one = VesselState::on_course(Position::ORIGIN, Nautical::NORTH, 5.0);
        let other = VesselState::on_course(Position { north_m: 10.0, east_m: 55.0 }, Nautical::NORTH, 5.0);
        assert!((hull.distance_m(&one, &hull, &other) - 35.0).abs() < 1e-9);
        assert_eq!(hull.distance_m(&one, &hull, &one), 0.0);
    }

    #[test]
    fn impossible_sizes_are_refused() {
        assert!(matches!(Hull::new(0.0, 1.0, Bow::Fine), Err(HullError::Size { .. })));
        assert!(matches!(Hull::new(f64::NAN, 1.0, Bow::Fine), Err(HullError::Size { .. })));
        assert!(matches!(Hull::new(20.0, 100.0, Bow::Fine), Err(HullError::Wide { .. })));
    }
}
