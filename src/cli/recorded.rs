//! Recorded tracks as commands import them: an area file, AIS files, the default thresholds.

use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::ais::{self, Area, ImportConfig};
use crate::geo::Geodetic;
use crate::track::Track;

/// Imported tracks.
pub(super) struct Recorded {
    pub tracks: Vec<Track>,
    /// Origin of the plane they lie in.
    pub origin: Geodetic,
}

/// Imports tracks with the default thresholds.
pub(super) fn import<'a>(area: &Path, files: impl Iterator<Item = &'a Path>) -> anyhow::Result<Recorded> {
    let remedy = "recorded tracks (paths are relative to the folder you are in; those of shipped models to the project's root)";
    let area = Area::load(area).context(remedy)?;
    let files: Vec<PathBuf> = files.map(Path::to_owned).collect();
    let import = ais::import(&files, &area, &ImportConfig::default(), None, &|_| ()).context(remedy)?;
    Ok(Recorded { tracks: import.tracks, origin: import.plane.origin })
}
