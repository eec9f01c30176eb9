//! The recorded tracks of a scenario: imported once however many targets use them, and the vessel
//! and moment a target asks for.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::encounter_starts::{HeadOnConfig, HeadOnKind, HeadOnStarts};
use super::model::{RecordedStart, RecordedVessel, TrackSource};
use crate::ais::{self, AisError, Area, ImportConfig, iso_utc};
use crate::config::Fault;
use crate::geo::LocalPlane;
use crate::track::Track;

/// Tracks and the plane they lie in.
pub(super) struct TrackSet {
    pub tracks: Arc<[Track]>,
    pub plane: LocalPlane,
}

/// Every source a scenario names, imported once.
#[derive(Default)]
pub(super) struct TrackLibrary {
    loaded: Vec<(TrackSource, TrackSet)>,
}

impl TrackLibrary {
    /// The tracks of a source.
    pub fn of(&mut self, source: &TrackSource) -> Result<&TrackSet, Fault> {
        let index = match self.loaded.iter().position(|(loaded, _)| loaded == source) {
            Some(index) => index,
            None => {
                self.loaded.push((source.clone(), load(source)?));
                self.loaded.len() - 1
            }
        };
        Ok(&self.loaded[index].1)
    }
}

fn load(source: &TrackSource) -> Result<TrackSet, Fault> {
    match source {
        TrackSource::Given { tracks, plane } => Ok(TrackSet { tracks: Arc::clone(tracks), plane: *plane }),
        TrackSource::Ais { files, area } => {
            let area = Area::load(area).map_err(|error| fault("area_file", error.into()))?;
            let import = ais::import(files, &area, &ImportConfig::default(), None, &|_| ());
            let import = import.map_err(|error| fault("ais_file", error))?;
            Ok(TrackSet { tracks: import.tracks.into(), plane: import.plane })
        }
        TrackSource::Directory(directory) => {
            let set = ais::load_tracks(directory).map_err(|error| fault("track_dir", error))?;
            Ok(TrackSet { tracks: set.tracks.into(), plane: set.plane })
        }
    }
}

/// What is wrong with a file that a key names: the file's own error, which says what to do.
fn fault(key: &str, error: AisError) -> Fault {
    Fault::new(key, error.to_string(), "correct that file, or name another")
}

/// A recorded vessel's track and the sample at which its replay starts.
pub(super) struct Replay<'t> {
    pub track: &'t Track,
    pub index: usize,
}

/// Finds what a target asks for among its tracks, `needed_s` of track after the start included.
pub(super) fn find<'t>(
    set: &'t TrackSet,
    recorded: &RecordedVessel,
    needed_s: f64,
    head_on: &HeadOnConfig,
    rng: &mut ChaCha8Rng,
) -> Result<Replay<'t>, Fault> {
    match recorded.start {
        RecordedStart::Time { mmsi, unix_s } => at_time(set, mmsi, unix_s, needed_s),
        RecordedStart::Rule { kind, mmsi, pick } => by_rule(set, kind, mmsi, pick, head_on, rng),
    }
}

fn at_time(set: &TrackSet, mmsi: u32, unix_s: f64, needed_s: f64) -> Result<Replay<'_>, Fault> {
    let of_vessel: Vec<&Track> = set.tracks.iter().filter(|track| track.mmsi == mmsi).collect();
    if of_vessel.is_empty() {
        return Err(Fault::new(
            "mmsi",
            format!("no track of vessel {mmsi} among the {} found", set.tracks.len()),
            format!("write one of {}", some_vessels(&set.tracks)),
        ));
    }
    let covers =
        |track: &&Track| (track.unix_s(0)..=track.unix_s(track.positions.len() - 1)).contains(&unix_s);
    let Some(track) = of_vessel.iter().copied().find(covers) else {
        let spans: Vec<String> = of_vessel.iter().map(|track| span(track)).collect();
        return Err(Fault::new(
            "time",
            format!("vessel {mmsi} has no track at that time"),
            format!("write a time within {}", spans.join(", ")),
        ));
    };
    let index = ((unix_s - track.unix_s(0)) / track.dt_s).round() as usize;
    let left_s = track.duration_s() - index as f64 * track.dt_s;
    if left_s + 1e-6 < needed_s {
        return Err(Fault::new(
            "time",
            format!(
                "the track of vessel {mmsi} ends {left_s:.0} s later, before the {needed_s:.0} s simulated"
            ),
            "write an earlier time or a shorter duration_s",
        ));
    }
    Ok(Replay { track, index })
}

fn by_rule<'t>(
    set: &'t TrackSet,
    kind: HeadOnKind,
    mmsi: Option<u32>,
    pick: Option<usize>,
    config: &HeadOnConfig,
    rng: &mut ChaCha8Rng,
) -> Result<Replay<'t>, Fault> {
    let mut starts = HeadOnStarts::find(&set.tracks, config);
    if let Some(mmsi) = mmsi {
        starts.keep_vessel(mmsi);
    }
    let found = starts.of(kind).len();
    let start = match pick {
        Some(pick) => starts.of(kind).get(pick - 1).copied(),
        None => starts.draw(kind, rng),
    };
    let start = start.ok_or_else(|| match pick {
        Some(_) if found > 0 => Fault::new(
            "pick",
            format!("{found} such starts are found"),
            format!("write a number from 1 to {found}, or leave pick out to draw one with the seed"),
        ),
        _ => Fault::new(
            if mmsi.is_some() { "mmsi" } else { "start" },
            format!("none of the {} tracks offers such a start", set.tracks.len()),
            "take another vessel or area, or name a vessel and a time",
        ),
    })?;
    Ok(Replay { track: &set.tracks[start.track], index: start.index })
}

/// A few of the vessels there are, for a message.
fn some_vessels(tracks: &[Track]) -> String {
    const SHOWN: usize = 5;
    let mut vessels: Vec<u32> = tracks.iter().map(|track| track.mmsi).collect();
    vessels.sort_unstable();
    vessels.dedup();
    let shown = vessels.iter().take(SHOWN).map(u32::to_string).collect::<Vec<_>>().join(", ");
    if vessels.len() > SHOWN { format!("{shown} and {} more", vessels.len() - SHOWN) } else { shown }
}

fn span(track: &Track) -> String {
    let end_s = track.start_unix_s + track.duration_s() as i64;
    format!("{} to {}", iso_utc(track.start_unix_s), iso_utc(end_s))
}
