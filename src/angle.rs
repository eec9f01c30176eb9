//! Nautical and mathematical angles, kept apart by type.
//!
//! A [`Nautical`] angle is measured clockwise from north (course, heading, true bearing); a
//! [`Mathematical`] angle counter-clockwise from east (the x axis of the local plane). Both hold
//! radians; degrees appear only in constructors and accessors that say so. A *difference* of two
//! nautical angles is a plain signed number of radians in `(-pi, pi]`, positive clockwise, that is
//! to starboard.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use serde::{Deserialize, Serialize};

/// Wraps an angle difference to `(-pi, pi]` radians.
#[must_use]
pub fn wrap_to_pi(angle_rad: f64) -> f64 {
    let wrapped = angle_rad - TAU * (angle_rad / TAU).round();
    if wrapped <= -PI { wrapped + TAU } else { wrapped.min(PI) }
}

/// Wraps an angle to `[0, 2 pi)` radians.
#[must_use]
pub fn wrap_to_two_pi(angle_rad: f64) -> f64 {
    let wrapped = angle_rad.rem_euclid(TAU);
    // `rem_euclid` rounds tiny negative angles up to exactly one turn.
    if wrapped >= TAU { 0.0 } else { wrapped }
}

/// A course, heading or true bearing: radians clockwise from north, in `[0, 2 pi)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Nautical(f64);

impl Nautical {
    /// Due north.
    pub const NORTH: Self = Self(0.0);

    /// From radians clockwise from north; any number of turns is accepted.
    #[must_use]
    pub fn from_radians(clockwise_from_north_rad: f64) -> Self {
        Self(wrap_to_two_pi(clockwise_from_north_rad))
    }

    /// From degrees clockwise from north; any number of turns is accepted.
    #[must_use]
    pub fn from_degrees(clockwise_from_north_deg: f64) -> Self {
        Self::from_radians(clockwise_from_north_deg.to_radians())
    }

    /// The direction in which a displacement or velocity points; north for the zero vector.
    #[must_use]
    pub fn of(north: f64, east: f64) -> Self {
        Self::from_radians(east.atan2(north))
    }

    /// Radians clockwise from north, in `[0, 2 pi)`.
    #[must_use]
    pub fn radians(self) -> f64 {
        self.0
    }

    /// Degrees clockwise from north, in `[0, 360)`.
    #[must_use]
    pub fn degrees(self) -> f64 {
        let degrees = self.0.to_degrees();
        if degrees >= 360.0 { 0.0 } else { degrees }
    }

    /// The angle turned when going from `from` to `self` the short way: radians in `(-pi, pi]`,
    /// positive to starboard (clockwise).
    #[must_use]
    pub fn turn_from(self, from: Self) -> f64 {
        wrap_to_pi(self.0 - from.0)
    }

    /// This direction turned by `starboard_rad` (negative turns to port).
    #[must_use]
    pub fn turned(self, starboard_rad: f64) -> Self {
        Self::from_radians(self.0 + starboard_rad)
    }

    /// The opposite direction.
    #[must_use]
    pub fn reciprocal(self) -> Self {
        self.turned(PI)
    }

    /// North component of the unit vector in this direction.
    #[must_use]
    pub fn cos(self) -> f64 {
        self.0.cos()
    }

    /// East component of the unit vector in this direction.
    #[must_use]
    pub fn sin(self) -> f64 {
        self.0.sin()
    }
}

impl From<Mathematical> for Nautical {
    fn from(angle: Mathematical) -> Self {
        Self::from_radians(FRAC_PI_2 - angle.0)
    }
}

/// An angle of the plane's mathematics: radians counter-clockwise from east, in `(-pi, pi]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mathematical(f64);

impl Mathematical {
    /// From radians counter-clockwise from east; any number of turns is accepted.
    #[must_use]
    pub fn from_radians(counter_clockwise_from_east_rad: f64) -> Self {
        Self(wrap_to_pi(counter_clockwise_from_east_rad))
    }

    /// Radians counter-clockwise from east, in `(-pi, pi]`.
    #[must_use]
    pub fn radians(self) -> f64 {
        self.0
    }
}

impl From<Nautical> for Mathematical {
    fn from(angle: Nautical) -> Self {
        Self::from_radians(FRAC_PI_2 - angle.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn half_a_turn_is_positive() {
        assert_eq!(wrap_to_pi(-PI), PI);
        assert_eq!(wrap_to_pi(PI), PI);
        assert_eq!(wrap_to_pi(3.0 * PI), PI);
    }

    #[test]
    fn cardinal_directions_convert() {
        for (nautical_deg, mathematical_deg) in [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (270.0, 180.0)] {
            let mathematical = Mathematical::from(Nautical::from_degrees(nautical_deg));
            assert!((mathematical.radians().to_degrees() - mathematical_deg).abs() < 1e-9);
        }
    }

    #[test]
    fn turning_across_north_takes_the_short_way() {
        let turn = Nautical::from_degrees(10.0).turn_from(Nautical::from_degrees(350.0));
        assert!((turn.to_degrees() - 20.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction_and_its_range(angle in -1e4..1e4_f64) {
            let signed = wrap_to_pi(angle);
            let positive = wrap_to_two_pi(angle);
            prop_assert!(signed > -PI && signed <= PI);
            prop_assert!((0.0..TAU).contains(&positive));
            for wrapped in [signed, positive] {
                prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-9);
                prop_assert!((wrapped.cos() - angle.cos()).abs() < 1e-9);
            }
        }

        #[test]
        fn conversion_to_mathematical_and_back_is_lossless(degrees in 0.0..360.0_f64) {
            let nautical = Nautical::from_degrees(degrees);
            let back = Nautical::from(Mathematical::from(nautical));
            prop_assert!(back.turn_from(nautical).abs() < 1e-12);
        }

        #[test]
        fn turns_compose(from in 0.0..360.0_f64, turn in -3.1..3.1_f64) {
            let from = Nautical::from_degrees(from);
            prop_assert!((from.turned(turn).turn_from(from) - turn).abs() < 1e-9);
        }
    }
}
