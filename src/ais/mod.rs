//! Recorded traffic: AIS messages in CSV files to tracks on a uniform time grid.
//!
//! [`import`] reads files side by side, keeps what lies in an [`Area`], cleans each vessel's
//! messages, splits them into trajectories and resamples these. Its [`Report`] accounts for every
//! message and every trajectory: kept, or dropped for one reason. Memory is proportional to what
//! the area keeps, not to the files.
//!
//! The stages, each its own file: `read` -> `area` -> `clean` -> `split` -> `resample`. The
//! layouts of CSV files are in `format`, one file each.

use std::path::PathBuf;

use rayon::prelude::*;

mod area;
mod clean;
mod config;
mod error;
mod format;
mod message;
mod read;
mod report;
mod resample;
mod ship_type;
mod split;
mod store;
mod vessel_tracks;

pub use area::{Area, Filter, GeoBox, TimeWindow};
pub use config::ImportConfig;
pub use error::AisError;
pub use format::ColumnMapping;
pub use read::Progress;
pub use read::time::{TimeForm, iso_utc};
pub use report::{
    BadRow, ClearedFields, Counts, FileReport, Intervals, MessageDrop, Messages, Reason, Report, Splits,
    TrackDrop, Tracks,
};
pub use store::{Provenance, TrackSet, load_tracks, write_import};

use message::Message;
use read::{Reading, read_files};
use vessel_tracks::VesselTracks;

use crate::geo::LocalPlane;
use crate::track::Track;

/// Tracks, and how they came about.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The tracks, ordered by start and MMSI.
    pub tracks: Vec<Track>,
    /// The plane their positions are on.
    pub plane: LocalPlane,
    /// The account of every message and every trajectory.
    pub report: Report,
    /// The first bad rows one by one, in the order of files and lines.
    pub bad_rows: Vec<BadRow>,
}

/// Imports AIS files: all of them are read, in parallel, and looked at as one recording.
///
/// A `mapping` describes the columns of layouts that are not known. The same files, area and
/// thresholds give the same import on any number of threads.
///
/// # Errors
/// Where no file is given, one cannot be opened, is empty or has an unknown header. A row that
/// cannot be read and a file that breaks off are no errors: the good rows around are kept, and
/// the report says what was lost.
pub fn import(
    files: &[PathBuf],
    area: &Area,
    config: &ImportConfig,
    mapping: Option<&ColumnMapping>,
    progress: Progress<'_>,
) -> Result<Import, AisError> {
    let mut reading = read_files(files, area, config, mapping, progress)?;
    filter_vessels(&mut reading, area);
    // Stable: at equal times the order of files and lines stays.
    reading.messages.par_sort_by_key(|message| (message.mmsi, message.unix_ms));
    let plane = area.plane();
    let by_vessel: Vec<&[Message]> = reading.messages.chunk_by(|a, b| a.mmsi == b.mmsi).collect();
    let vessels: Vec<(u32, VesselTracks)> = by_vessel
        .into_par_iter()
        .filter_map(|messages| {
            let mmsi = messages.first()?.mmsi;
            let particulars = reading.vessels.get(&mmsi).cloned().unwrap_or_default();
            Some((mmsi, VesselTracks::of(messages, &particulars, area, &plane, config)))
        })
        .collect();
    Ok(account(reading, vessels, plane))
}

/// Leaves out the vessels whose type or length the area does not ask for. What a vessel is may be
/// said in one message only, so this waits until all are read.
fn filter_vessels(reading: &mut Reading, area: &Area) {
    let filter = &area.filter;
    let wanted: Vec<_> = filter.ship_types.iter().filter_map(|text| ship_type::Wanted::parse(text)).collect();
    let bounded = |length_m: f64| {
        filter.min_length_m.is_none_or(|least| length_m >= least)
            && filter.max_length_m.is_none_or(|most| length_m <= most)
    };
    let by_length = filter.min_length_m.is_some() || filter.max_length_m.is_some();
    if wanted.is_empty() && !by_length {
        return;
    }
    let Reading { messages, vessels, dropped, .. } = reading;
    messages.retain(|message| {
        let vessel = vessels.get(&message.mmsi);
        let ship_type = vessel.and_then(|vessel| vessel.ship_type.as_deref());
        let length_m = vessel.and_then(|vessel| vessel.length_m);
        if !wanted.is_empty() && !ship_type.is_some_and(|has| wanted.iter().any(|wanted| wanted.holds(has))) {
            dropped.add(MessageDrop::FilteredShipType, 1);
            return false;
        }
        if by_length && !length_m.is_some_and(bounded) {
            dropped.add(MessageDrop::FilteredLength, 1);
            return false;
        }
        true
    });
}

fn account(reading: Reading, vessels: Vec<(u32, VesselTracks)>, plane: LocalPlane) -> Import {
    let read = reading.files.iter().map(|file| file.read).sum();
    let mut messages = Messages { read, kept: 0, dropped: reading.dropped };
    let mut tracks = Tracks { found: 0, kept: 0, dropped: Counts::default() };
    let (mut splits, mut intervals) = (Splits::default(), Intervals::default());
    let (mut shared_mmsi, mut kept_tracks) = (Vec::new(), Vec::new());
    for (mmsi, vessel) in vessels {
        messages.kept += vessel.kept;
        messages.dropped.merge(&vessel.dropped);
        tracks.found += vessel.found;
        tracks.kept += vessel.tracks.len() as u64;
        tracks.dropped.merge(&vessel.dropped_tracks);
        splits.gap += vessel.splits.gap;
        splits.jump += vessel.splits.jump;
        splits.stop += vessel.splits.stop;
        intervals.spline += vessel.intervals.spline;
        intervals.shape_preserving += vessel.intervals.shape_preserving;
        intervals.straight += vessel.intervals.straight;
        if vessel.shared {
            shared_mmsi.push(mmsi);
        }
        kept_tracks.extend(vessel.tracks);
    }
    kept_tracks.sort_by_key(|track: &Track| (track.start_unix_s, track.mmsi));
    let report = Report {
        messages,
        tracks,
        cleared_fields: reading.cleared,
        splits,
        intervals,
        shared_mmsi,
        files: reading.files,
    };
    debug_assert!(report.adds_up(), "{report:?}");
    Import { tracks: kept_tracks, plane, report, bad_rows: reading.bad_rows }
}
