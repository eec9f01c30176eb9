//! Positions on the earth and on a local plane, kept apart by type.
//!
//! [`Geodetic`] is a point on the WGS84 ellipsoid. [`Position`] is a point of a [`LocalPlane`], in
//! metres north and east of its origin; [`Displacement`] and [`Velocity`] are its vectors.
//!
//! The plane touches the ellipsoid at its origin and is azimuthal equidistant: a point keeps its
//! geodesic distance and azimuth from the origin exactly. Distances between two other points are
//! stretched across the radius by at most `r^2 / (6 R^2)`: 2.6 parts per million at `r = 25 km`,
//! which is 0.13 m over 50 km. Azimuths away from the origin turn by the convergence of meridians.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use geographiclib_rs::{DirectGeodesic, Geodesic, InverseGeodesic};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::angle::Nautical;

/// Metres per second in one knot (exact: one nautical mile of 1852 m per hour).
pub const MPS_PER_KNOT: f64 = 1852.0 / 3600.0;
/// Metres in one nautical mile (exact).
pub const M_PER_NMI: f64 = 1852.0;

/// Brings a longitude in degrees to `[-180, 180)`.
#[must_use]
pub fn wrap_longitude_deg(longitude_deg: f64) -> f64 {
    if (-180.0..180.0).contains(&longitude_deg) {
        return longitude_deg;
    }
    let wrapped = (longitude_deg + 180.0).rem_euclid(360.0) - 180.0;
    if wrapped >= 180.0 { -180.0 } else { wrapped }
}

/// A point on the WGS84 ellipsoid, in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Geodetic {
    /// Degrees north of the equator, in `[-90, 90]`.
    pub latitude_deg: f64,
    /// Degrees east of Greenwich, in `[-180, 180)` after [`Geodetic::checked`].
    pub longitude_deg: f64,
}

impl Geodetic {
    /// The point with its longitude wrapped, or nothing where it is not on the earth: not finite,
    /// a latitude beyond 90 degrees or a longitude beyond 180 degrees either way.
    #[must_use]
    pub fn checked(self) -> Option<Self> {
        let valid = self.latitude_deg.abs() <= 90.0 && self.longitude_deg.abs() <= 180.0;
        valid.then(|| Self { longitude_deg: wrap_longitude_deg(self.longitude_deg), ..self })
    }
}

/// A point of a local plane, in metres from the plane's origin.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Metres north of the origin.
    pub north_m: f64,
    /// Metres east of the origin.
    pub east_m: f64,
}

/// A vector between two points of a local plane, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Displacement {
    /// Metres towards north.
    pub north_m: f64,
    /// Metres towards east.
    pub east_m: f64,
}

/// A velocity over ground in a local plane.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Velocity {
    /// Metres per second towards north.
    pub north_mps: f64,
    /// Metres per second towards east.
    pub east_mps: f64,
}

impl Position {
    /// The plane's origin.
    pub const ORIGIN: Self = Self { north_m: 0.0, east_m: 0.0 };

    /// Distance to another point, in metres.
    #[must_use]
    pub fn distance_m(self, other: Self) -> f64 {
        (self - other).length_m()
    }

    /// The point a fraction of the way from `self` (0) to `other` (1).
    #[must_use]
    pub fn lerp(self, other: Self, fraction: f64) -> Self {
        self + (other - self) * fraction
    }

    /// Whether both coordinates are finite numbers.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.north_m.is_finite() && self.east_m.is_finite()
    }

    /// As a vector with x to the east and y to the north: the right-handed axes of `crate::cpa`.
    #[must_use]
    pub fn xy(self) -> Vector2<f64> {
        Vector2::new(self.east_m, self.north_m)
    }
}

impl Displacement {
    /// A step of `distance_m` in a direction.
    #[must_use]
    pub fn towards(direction: Nautical, distance_m: f64) -> Self {
        Self { north_m: distance_m * direction.cos(), east_m: distance_m * direction.sin() }
    }

    /// Its length, in metres.
    #[must_use]
    pub fn length_m(self) -> f64 {
        self.north_m.hypot(self.east_m)
    }

    /// Its true bearing; north for the zero vector.
    #[must_use]
    pub fn bearing(self) -> Nautical {
        Nautical::of(self.north_m, self.east_m)
    }

    /// Metres along a direction (negative: astern of it).
    #[must_use]
    pub fn along_m(self, direction: Nautical) -> f64 {
        self.north_m * direction.cos() + self.east_m * direction.sin()
    }

    /// Metres to starboard of a direction (negative: to port).
    #[must_use]
    pub fn starboard_of_m(self, direction: Nautical) -> f64 {
        self.east_m * direction.cos() - self.north_m * direction.sin()
    }

    /// The velocity that covers this displacement in `duration_s`.
    #[must_use]
    pub fn per_seconds(self, duration_s: f64) -> Velocity {
        Velocity { north_mps: self.north_m / duration_s, east_mps: self.east_m / duration_s }
    }
}

impl Velocity {
    /// From speed and course over ground.
    #[must_use]
    pub fn from_course(course: Nautical, speed_mps: f64) -> Self {
        Self { north_mps: speed_mps * course.cos(), east_mps: speed_mps * course.sin() }
    }

    /// Speed over ground, in metres per second.
    #[must_use]
    pub fn speed_mps(self) -> f64 {
        self.north_mps.hypot(self.east_mps)
    }

    /// Course over ground; north for the zero velocity.
    #[must_use]
    pub fn course(self) -> Nautical {
        Nautical::of(self.north_mps, self.east_mps)
    }

    /// The way made good in `duration_s`.
    #[must_use]
    pub fn for_seconds(self, duration_s: f64) -> Displacement {
        Displacement { north_m: self.north_mps * duration_s, east_m: self.east_mps * duration_s }
    }

    /// As a vector with x to the east and y to the north: the right-handed axes of `crate::cpa`.
    #[must_use]
    pub fn xy(self) -> Vector2<f64> {
        Vector2::new(self.east_mps, self.north_mps)
    }
}

impl Sub for Position {
    type Output = Displacement;
    fn sub(self, from: Self) -> Displacement {
        Displacement { north_m: self.north_m - from.north_m, east_m: self.east_m - from.east_m }
    }
}

impl Add<Displacement> for Position {
    type Output = Self;
    fn add(self, step: Displacement) -> Self {
        Self { north_m: self.north_m + step.north_m, east_m: self.east_m + step.east_m }
    }
}

impl Sub<Displacement> for Position {
    type Output = Self;
    fn sub(self, step: Displacement) -> Self {
        self + -step
    }
}

impl AddAssign<Displacement> for Position {
    fn add_assign(&mut self, step: Displacement) {
        *self = *self + step;
    }
}

impl Add for Displacement {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { north_m: self.north_m + other.north_m, east_m: self.east_m + other.east_m }
    }
}

impl Neg for Displacement {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Mul<f64> for Displacement {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { north_m: self.north_m * factor, east_m: self.east_m * factor }
    }
}

impl Sub for Velocity {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { north_mps: self.north_mps - other.north_mps, east_mps: self.east_mps - other.east_mps }
    }
}

impl Add for Velocity {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { north_mps: self.north_mps + other.north_mps, east_mps: self.east_mps + other.east_mps }
    }
}

/// A plane that touches the WGS84 ellipsoid at `origin`, azimuthal equidistant about it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LocalPlane {
    /// The point of contact, where `north_m` and `east_m` are zero.
    pub origin: Geodetic,
}

impl LocalPlane {
    /// The plane that touches the ellipsoid at `origin`.
    #[must_use]
    pub fn at(origin: Geodetic) -> Self {
        Self { origin }
    }

    /// Where a point of the ellipsoid lies in the plane; right across the antimeridian too.
    #[must_use]
    pub fn project(&self, point: Geodetic) -> Position {
        let (distance_m, azimuth_deg, ..): (f64, f64, f64, f64) = Geodesic::wgs84().inverse(
            self.origin.latitude_deg,
            self.origin.longitude_deg,
            point.latitude_deg,
            point.longitude_deg,
        );
        Position::ORIGIN + Displacement::towards(Nautical::from_degrees(azimuth_deg), distance_m)
    }

    /// The point of the ellipsoid at a position of the plane: the inverse of [`Self::project`].
    #[must_use]
    pub fn unproject(&self, position: Position) -> Geodetic {
        let from_origin = position - Position::ORIGIN;
        let (latitude_deg, longitude_deg): (f64, f64) = Geodesic::wgs84().direct(
            self.origin.latitude_deg,
            self.origin.longitude_deg,
            from_origin.bearing().degrees(),
            from_origin.length_m(),
        );
        Geodetic { latitude_deg, longitude_deg: wrap_longitude_deg(longitude_deg) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn geodesic_m(a: Geodetic, b: Geodetic) -> f64 {
        Geodesic::wgs84().inverse(a.latitude_deg, a.longitude_deg, b.latitude_deg, b.longitude_deg)
    }

    #[test]
    fn starboard_is_to_the_right_of_a_course() {
        let north_east = Displacement { north_m: 1.0, east_m: 1.0 };
        assert!(north_east.starboard_of_m(Nautical::NORTH) > 0.99);
        assert!(north_east.starboard_of_m(Nautical::from_degrees(90.0)) < -0.99);
        assert!((north_east.along_m(Nautical::from_degrees(45.0)) - 2_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn points_off_the_earth_are_refused() {
        for (latitude_deg, longitude_deg) in
            [(91.0, 0.0), (0.0, 181.0), (f64::NAN, 0.0), (0.0, f64::INFINITY)]
        {
            assert_eq!(Geodetic { latitude_deg, longitude_deg }.checked(), None);
        }
    }

    #[test]
    fn the_plane_reaches_across_the_antimeridian() {
        let plane = LocalPlane::at(Geodetic { latitude_deg: -17.0, longitude_deg: 179.99 });
        let position = plane.project(Geodetic { latitude_deg: -17.0, longitude_deg: -179.99 });
        assert!((position.east_m - 2129.0).abs() < 2.0, "{position:?}");
        let back = plane.unproject(position);
        assert!((back.longitude_deg + 179.99).abs() < 1e-9);
    }

    proptest! {
        /// The bound stated in the module's documentation, over an area 50 km across.
        #[test]
        fn plane_distances_match_the_geodesic_over_50_km(
            latitude_deg in -70.0..70.0_f64,
            longitude_deg in -180.0..180.0_f64,
            a in (-17_600.0..17_600.0_f64, -17_600.0..17_600.0_f64),
            b in (-17_600.0..17_600.0_f64, -17_600.0..17_600.0_f64),
        ) {
            let plane = LocalPlane::at(Geodetic { latitude_deg, longitude_deg });
            let a = Position { north_m: a.0, east_m: a.1 };
            let b = Position { north_m: b.0, east_m: b.1 };
            let geodesic = geodesic_m(plane.unproject(a), plane.unproject(b));
            prop_assert!((a.distance_m(b) - geodesic).abs() <= 2.65e-6 * geodesic + 1e-6);
        }

        #[test]
        fn projecting_and_back_is_lossless(
            latitude_deg in -80.0..80.0_f64,
            longitude_deg in -180.0..180.0_f64,
            north_m in -50_000.0..50_000.0_f64,
            east_m in -50_000.0..50_000.0_f64,
        ) {
            let plane = LocalPlane::at(Geodetic { latitude_deg, longitude_deg });
            let position = Position { north_m, east_m };
            let back = plane.project(plane.unproject(position));
            prop_assert!(back.distance_m(position) < 1e-6);
        }

        #[test]
        fn wrapped_longitudes_stay_in_range(longitude in -1e4..1e4_f64) {
            let wrapped = wrap_longitude_deg(longitude);
            prop_assert!((-180.0..180.0).contains(&wrapped));
            prop_assert!(((longitude - wrapped) / 360.0 - ((longitude - wrapped) / 360.0).round()).abs() < 1e-9);
        }
    }
}
