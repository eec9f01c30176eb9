//! A vessel's path on a uniform time grid: what every recorded motion is replayed from.

use serde::{Deserialize, Serialize};

use crate::angle::Nautical;
use crate::geo::{Position, Velocity};

/// What is known of a vessel beside where it went. Nothing here is needed to replay it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct VesselParticulars {
    /// Length over all, in metres.
    pub length_m: Option<f64>,
    /// Greatest beam, in metres.
    pub beam_m: Option<f64>,
    /// Ship type as the source writes it: a word (`Cargo`) or an AIS code (`70`).
    pub ship_type: Option<String>,
}

/// Positions of one vessel, `dt_s` apart, in the local plane of its area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Maritime Mobile Service Identity of the vessel.
    pub mmsi: u32,
    /// Time of the first position, in seconds since 1970-01-01 00:00:00 UTC.
    pub start_unix_s: i64,
    /// Time between two positions, in seconds.
    pub dt_s: f64,
    /// The positions; two at least.
    pub positions: Vec<Position>,
    /// What else is known of the vessel.
    pub particulars: VesselParticulars,
}

impl Track {
    /// Time from the first to the last position, in seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.dt_s * (self.positions.len().saturating_sub(1)) as f64
    }

    /// Time of position `index`, in seconds since 1970-01-01 00:00:00 UTC.
    #[must_use]
    pub fn unix_s(&self, index: usize) -> f64 {
        self.start_unix_s as f64 + self.dt_s * index as f64
    }

    /// Where the vessel is `time_s` after its start: straight lines between positions, held at
    /// either end.
    #[must_use]
    pub fn position_at(&self, time_s: f64) -> Position {
        let last = self.positions.len() - 1;
        let steps = (time_s / self.dt_s).clamp(0.0, last as f64);
        let index = (steps as usize).min(last.saturating_sub(1));
        self.positions[index].lerp(self.positions[(index + 1).min(last)], steps - index as f64)
    }

    /// Velocity over the step from position `index` to the next; at the last position, over the
    /// step that led there.
    #[must_use]
    pub fn velocity(&self, index: usize) -> Velocity {
        let from = index.min(self.positions.len().saturating_sub(2));
        let to = (from + 1).min(self.positions.len() - 1);
        (self.positions[to] - self.positions[from]).per_seconds(self.dt_s)
    }

    /// Course over ground at position `index`.
    #[must_use]
    pub fn course(&self, index: usize) -> Nautical {
        self.velocity(index).course()
    }

    /// Length of the path, in metres.
    #[must_use]
    pub fn path_length_m(&self) -> f64 {
        self.positions.windows(2).map(|pair| pair[0].distance_m(pair[1])).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track() -> Track {
        let positions = [(0.0, 0.0), (50.0, 0.0), (50.0, 50.0)]
            .map(|(north_m, east_m)| Position { north_m, east_m })
            .to_vec();
        Track {
            mmsi: 219_000_001,
            start_unix_s: 1000,
            dt_s: 5.0,
            positions,
            particulars: VesselParticulars::default(),
        }
    }

    #[test]
    fn positions_between_samples_lie_on_straight_lines() {
        let track = track();
        assert_eq!(track.position_at(2.5), Position { north_m: 25.0, east_m: 0.0 });
        assert_eq!(track.position_at(7.5), Position { north_m: 50.0, east_m: 25.0 });
    }

    #[test]
    fn a_track_is_held_at_its_ends() {
        let track = track();
        assert_eq!(track.position_at(-1.0), track.positions[0]);
        assert_eq!(track.position_at(99.0), track.positions[2]);
        assert_eq!(track.velocity(2), track.velocity(1));
        assert_eq!(track.course(2).degrees(), 90.0);
    }

    #[test]
    fn lengths_and_times_add_up() {
        let track = track();
        assert_eq!(track.path_length_m(), 100.0);
        assert_eq!(track.duration_s(), 10.0);
        assert_eq!(track.unix_s(2), 1010.0);
    }
}
