//! Replay of a recorded track.

use std::sync::Arc;

use super::{Motion, VesselState};
use crate::angle::Nautical;
use crate::geo::Position;
use crate::track::Track;

/// Way made good, in metres, under which two samples are too close to tell a course from.
const COURSE_BASE_M: f64 = 0.5;

/// A track replayed from a moment of its own time on: straight lines between its positions, held
/// at either end.
///
/// The heading is the course made good from one sample before to one after; where the vessel
/// hardly moves, it keeps the last heading that could be told.
#[derive(Debug, Clone)]
pub struct Recorded {
    track: Arc<Track>,
    headings: Arc<[Nautical]>,
    offset_s: f64,
    dt_s: f64,
}

impl Recorded {
    /// Replays `track` so that step 0 falls on its start; steps are `dt_s` apart, whatever the
    /// spacing of the track.
    #[must_use]
    pub fn new(track: Arc<Track>, dt_s: f64) -> Self {
        let headings = headings_of(&track);
        Self { track, headings, offset_s: 0.0, dt_s }
    }

    /// The same replay with step 0 falling `offset_s` seconds after the start of the track.
    #[must_use]
    pub fn from_offset(&self, offset_s: f64) -> Self {
        Self { offset_s, ..self.clone() }
    }

    /// What is replayed.
    #[must_use]
    pub fn track(&self) -> &Track {
        &self.track
    }

    /// The first and last step that the recording covers; beyond them the vessel lies still.
    #[must_use]
    pub fn covered_steps(&self) -> (i64, i64) {
        let first = -self.offset_s / self.dt_s;
        let last = (self.track.duration_s() - self.offset_s) / self.dt_s;
        (first.ceil() as i64, last.floor() as i64)
    }

    fn track_time_s(&self, step: i64) -> f64 {
        self.offset_s + step as f64 * self.dt_s
    }
}

fn headings_of(track: &Track) -> Arc<[Nautical]> {
    let positions = &track.positions;
    let last = positions.len() - 1;
    let told = |index: usize| {
        let way = positions[(index + 1).min(last)] - positions[index.saturating_sub(1)];
        (way.length_m() >= COURSE_BASE_M).then(|| way.bearing())
    };
    let mut heading = (0..=last).find_map(told).unwrap_or(Nautical::NORTH);
    (0..=last)
        .map(|index| {
            heading = told(index).unwrap_or(heading);
            heading
        })
        .collect()
}

impl Motion for Recorded {
    fn position(&self, step: i64) -> Position {
        self.track.position_at(self.track_time_s(step))
    }

    fn state(&self, step: i64) -> VesselState {
        let position = self.position(step);
        let samples =
            (self.track_time_s(step) / self.track.dt_s).clamp(0.0, (self.headings.len() - 1) as f64);
        let before = self.headings[samples.floor() as usize];
        let after = self.headings[samples.ceil() as usize];
        VesselState {
            position,
            velocity: (self.position(step + 1) - position).per_seconds(self.dt_s),
            heading: before.turned(after.turn_from(before) * samples.fract()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::VesselParticulars;

    /// North for ten samples at 8 m/s, then east for ten.
    fn corner() -> Arc<Track> {
        let positions = (0..20)
            .map(|k| Position {
                north_m: 40.0 * f64::from(k.min(10)),
                east_m: 40.0 * f64::from((k - 10).max(0)),
            })
            .collect();
        Arc::new(Track {
            mmsi: 219_000_001,
            start_unix_s: 0,
            dt_s: 5.0,
            positions,
            particulars: VesselParticulars::default(),
        })
    }

    #[test]
    fn an_offset_moves_the_start() {
        let replay = Recorded::new(corner(), 5.0).from_offset(25.0);
        assert_eq!(replay.covered_steps(), (-5, 14));
        assert_eq!(replay.position(0), Position { north_m: 200.0, east_m: 0.0 });
        assert_eq!(replay.position(-5), Position::ORIGIN);
        assert_eq!(replay.position(-9), Position::ORIGIN);
        assert_eq!(replay.state(7).velocity.east_mps, 8.0);
        assert_eq!(replay.state(14).velocity.speed_mps(), 0.0);
    }

    #[test]
    fn the_bow_comes_round_at_a_corner() {
        let replay = Recorded::new(corner(), 5.0);
        let headings = [9, 10, 11].map(|step| replay.state(step).heading.degrees().round());
        assert_eq!(headings, [0.0, 45.0, 90.0]);
        let finer = Recorded::new(corner(), 2.5);
        assert!((finer.state(19).heading.degrees() - 22.5).abs() < 1e-9);
        assert_eq!(finer.position(1), Position { north_m: 20.0, east_m: 0.0 });
    }

    #[test]
    fn a_vessel_that_lies_still_keeps_its_heading() {
        let mut track = Track::clone(&corner());
        let berth = track.positions[19];
        track.positions.extend([berth; 5]);
        track.positions.push(Position { north_m: berth.north_m + 0.1, ..berth });
        let replay = Recorded::new(Arc::new(track), 5.0);
        assert_eq!(replay.state(25).heading.degrees().round(), 90.0);
    }
}
