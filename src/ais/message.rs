//! One position report, and what identifies its sender.

use crate::geo::Geodetic;

/// A position report of a vessel inside the area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Message {
    /// Maritime Mobile Service Identity.
    pub mmsi: u32,
    /// Milliseconds since 1970-01-01 00:00:00 UTC.
    pub unix_ms: i64,
    /// Where the vessel says it is.
    pub position: Geodetic,
    /// Speed over ground in metres per second; not a number where unknown.
    pub sog_mps: f32,
    /// Course over ground in degrees, in `[0, 360)`; not a number where unknown.
    pub cog_deg: f32,
    /// Heading in degrees, in `[0, 360)`; not a number where unknown.
    pub heading_deg: f32,
}

/// What kind of station an MMSI belongs to, by its leading digits (ITU-R M.585-9, annex 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Station {
    /// A ship, or a craft that belongs to one.
    Vessel,
    /// A coast station, aid to navigation, aircraft, handheld or distress beacon.
    Other,
    /// No station has such a number.
    Impossible,
}

impl Station {
    /// Tells an MMSI's kind of station.
    pub fn of(mmsi: u32) -> Self {
        let country = |first_digits: u32| matches!(first_digits, 201..=775);
        match mmsi {
            // Coast stations and groups are written with leading zeros, which a number loses.
            2_010_000..=7_759_999 | 20_100_000..=77_599_999 => Self::Other,
            111_000_000..=111_999_999 if mmsi != 111_111_111 => Self::Other,
            201_000_000..=775_999_999 if !mmsi.is_multiple_of(111_111_111) => Self::Vessel,
            800_000_000..=899_999_999 if country(mmsi / 100_000 % 1000) => Self::Other,
            970_000_000..=970_999_999 | 972_000_000..=972_999_999 | 974_000_000..=974_999_999 => Self::Other,
            980_000_000..=989_999_999 if country(mmsi / 10_000 % 1000) => Self::Vessel,
            990_000_000..=999_999_999 if country(mmsi / 10_000 % 1000) => Self::Other,
            _ => Self::Impossible,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stations_are_told_by_their_digits() {
        for vessel in [219_900_023, 367_466_930, 982_191_234] {
            assert_eq!(Station::of(vessel), Station::Vessel, "{vessel}");
        }
        // A Danish base station (002190047), an aid to navigation, a search aircraft, a beacon.
        for other in [2_190_047, 992_191_234, 111_219_501, 970_123_456, 821_912_345] {
            assert_eq!(Station::of(other), Station::Other, "{other}");
        }
        for impossible in
            [0, 1, 111_111_111, 222_222_222, 199_999_999, 776_000_000, 999_999_999, 1_000_000_000]
        {
            assert_eq!(Station::of(impossible), Station::Impossible, "{impossible}");
        }
    }
}
