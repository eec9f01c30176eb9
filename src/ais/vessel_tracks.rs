//! One vessel's messages to its tracks: clean, split, select, resample.

use super::area::{Area, Filter};
use super::clean::{Fix, without_repetitions, without_spikes};
use super::config::ImportConfig;
use super::message::Message;
use super::report::{Counts, Intervals, MessageDrop, Splits, TrackDrop};
use super::resample::{Interval, Path};
use super::split::{at_stops, into_strands};
use crate::geo::{LocalPlane, MPS_PER_KNOT, Position};
use crate::track::{Track, VesselParticulars};

/// What became of one vessel's messages.
#[derive(Debug, Default)]
pub struct VesselTracks {
    /// Its tracks, in order of time.
    pub tracks: Vec<Track>,
    /// Trajectories found.
    pub found: u64,
    /// Messages that are fixes of a track.
    pub kept: u64,
    /// The other messages.
    pub dropped: Counts<MessageDrop>,
    /// Trajectories that are no track.
    pub dropped_tracks: Counts<TrackDrop>,
    /// Cuts between trajectories.
    pub splits: Splits,
    /// How the tracks bridge the intervals between their fixes.
    pub intervals: Intervals,
    /// Whether two vessels seem to share the MMSI.
    pub shared: bool,
}

impl VesselTracks {
    /// Makes tracks of one vessel's messages, which are ordered by time.
    pub fn of(
        messages: &[Message],
        particulars: &VesselParticulars,
        area: &Area,
        plane: &LocalPlane,
        config: &ImportConfig,
    ) -> Self {
        let mut vessel = Self::default();
        let Some(mmsi) = messages.first().map(|message| message.mmsi) else { return vessel };
        let fixes = without_repetitions(messages, plane, config, &mut vessel.dropped);
        let strands = into_strands(&fixes, config, &mut vessel.dropped);
        (vessel.splits, vessel.shared) = (strands.splits, strands.shared);
        for strand in strands.strands {
            let strand = without_spikes(&strand, config, &mut vessel.dropped);
            // Without its spikes a strand may have gaps.
            let pieces: Vec<&[Fix]> = strand
                .chunk_by(|a, b| {
                    b.seconds_since(a) <= config.max_gap_s && b.speed_from_mps(a) <= config.max_speed_mps
                })
                .collect();
            vessel.splits.gap += pieces.len().saturating_sub(1) as u64;
            for piece in pieces {
                for trajectory in at_stops(piece.to_vec(), config, &mut vessel.splits) {
                    vessel.take(mmsi, &trajectory, particulars, area, config);
                }
            }
        }
        vessel
    }

    fn take(
        &mut self,
        mmsi: u32,
        fixes: &[Fix],
        particulars: &VesselParticulars,
        area: &Area,
        config: &ImportConfig,
    ) {
        self.found += 1;
        match make_track(mmsi, fixes, particulars, &area.filter, config) {
            Ok((track, path)) => {
                self.kept += fixes.len() as u64;
                for interval in path.intervals {
                    match interval {
                        Interval::Spline => self.intervals.spline += 1,
                        Interval::ShapePreserving => self.intervals.shape_preserving += 1,
                        Interval::Straight => self.intervals.straight += 1,
                    }
                }
                self.tracks.push(track);
            }
            Err(reason) => {
                self.dropped_tracks.add(reason, 1);
                self.dropped.add(reason.into(), fixes.len() as u64);
            }
        }
    }
}

fn make_track(
    mmsi: u32,
    fixes: &[Fix],
    particulars: &VesselParticulars,
    filter: &Filter,
    config: &ImportConfig,
) -> Result<(Track, Path), TrackDrop> {
    let ([first, .., last], true) = (fixes, fixes.len() >= config.min_fixes) else {
        return Err(TrackDrop::TooFewFixes);
    };
    if last.seconds_since(first) < config.min_duration_s {
        return Err(TrackDrop::TooShort);
    }
    if extent_m(fixes) <= config.moored_extent_m {
        return Err(TrackDrop::Moored);
    }
    // Positions fall on whole multiples of the time step, so that all tracks share one grid.
    let dt_ms = i64::from(config.dt_s) * 1000;
    let start_ms = first.unix_ms + (-first.unix_ms).rem_euclid(dt_ms);
    let path = Path::through(fixes, config);
    let dt_s = f64::from(config.dt_s);
    let positions = path.sampled((start_ms - first.unix_ms) as f64 / 1000.0, dt_s);
    if positions.len() < 2 {
        return Err(TrackDrop::TooShort);
    }
    let track =
        Track { mmsi, start_unix_s: start_ms / 1000, dt_s, positions, particulars: particulars.clone() };
    let mean_speed_kn = track.path_length_m() / track.duration_s() / MPS_PER_KNOT;
    let too_slow = filter.min_mean_speed_kn.is_some_and(|least| mean_speed_kn < least);
    let too_fast = filter.max_mean_speed_kn.is_some_and(|most| mean_speed_kn > most);
    if too_slow || too_fast { Err(TrackDrop::FilteredSpeed) } else { Ok((track, path)) }
}

/// Diagonal of the box around the fixes, in metres.
fn extent_m(fixes: &[Fix]) -> f64 {
    let start =
        (Position { north_m: f64::INFINITY, east_m: f64::INFINITY }, f64::NEG_INFINITY, f64::NEG_INFINITY);
    let (low, north_m, east_m) = fixes.iter().fold(start, |(low, north_m, east_m), fix| {
        let at = fix.position;
        let low = Position { north_m: low.north_m.min(at.north_m), east_m: low.east_m.min(at.east_m) };
        (low, north_m.max(at.north_m), east_m.max(at.east_m))
    });
    low.distance_m(Position { north_m, east_m })
}
