//! Encounter starts kept on disk: finding them sails every track twice from every candidate.
//!
//! A file is named after the SHA-256 of what its starts follow from: every track and the configuration. It is written
//! whole or not at all, so that processes may share a folder. A file that is damaged, or is of something else, is not
//! believed: the starts are found anew, the file is replaced, and a remark says so.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::encounter_starts::{HeadOnConfig, HeadOnStarts};
use crate::atomic_file;
use crate::track::Track;

/// Counted up whenever the search changes its results.
const SEARCH_VERSION: u32 = 1;

/// A folder of encounter starts, or none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StartsCache {
    folder: Option<PathBuf>,
}

/// Starts and what there is to say of how they were come by.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CachedStarts {
    /// The starts.
    pub starts: HeadOnStarts,
    /// Whether they were read from the cache.
    pub was_cached: bool,
    /// Why the cache did not serve, where it should have.
    pub remark: Option<String>,
}

/// What a file holds.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    key: String,
    starts: HeadOnStarts,
}

impl StartsCache {
    /// In a folder, which is made when the first file is written.
    #[must_use]
    pub fn in_folder(folder: PathBuf) -> Self {
        Self { folder: Some(folder) }
    }

    /// Keeps nothing.
    #[must_use]
    pub fn off() -> Self {
        Self { folder: None }
    }

    /// The starts on the tracks: as [`HeadOnStarts::find`], from the cache where it has them.
    #[must_use]
    pub fn find(&self, tracks: &[Track], config: &HeadOnConfig) -> CachedStarts {
        let Some(folder) = &self.folder else {
            return CachedStarts {
                starts: HeadOnStarts::find(tracks, config),
                was_cached: false,
                remark: None,
            };
        };
        let key = key_of(tracks, config);
        let path = folder.join(format!("encounter-starts-{key}.json"));
        let mut remark = None;
        match read(&path, &key, tracks) {
            Ok(Some(starts)) => return CachedStarts { starts, was_cached: true, remark: None },
            Ok(None) => {}
            Err(reason) => remark = Some(format!("{}: {reason}; found the starts anew", path.display())),
        }
        let entry = Entry { key, starts: HeadOnStarts::find(tracks, config) };
        let written = atomic_file::write(&path, |file| Ok(serde_json::to_writer(file, &entry)?));
        if let Err(error) = written {
            remark = Some(format!("the encounter starts were not kept for the next time: {error}"));
        }
        CachedStarts { starts: entry.starts, was_cached: false, remark }
    }
}

/// What the file holds; nothing where there is none.
fn read(path: &Path, key: &str, tracks: &[Track]) -> Result<Option<HeadOnStarts>, String> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(format!("cannot be read ({error})")),
    };
    let entry: Entry = serde_json::from_slice(&bytes).map_err(|error| format!("is damaged ({error})"))?;
    if entry.key != key || !entry.starts.are_on(tracks) {
        return Err("is of other tracks".into());
    }
    Ok(Some(entry.starts))
}

/// The hash, in hexadecimal, of everything that the starts follow from.
fn key_of(tracks: &[Track], config: &HeadOnConfig) -> String {
    let mut hash = Sha256::new();
    hash.update(SEARCH_VERSION.to_le_bytes());
    hash.update(serde_json::to_vec(config).expect("plain data with string keys"));
    for track in tracks {
        hash.update(track.mmsi.to_le_bytes());
        hash.update(track.start_unix_s.to_le_bytes());
        hash.update(track.dt_s.to_le_bytes());
        hash.update((track.positions.len() as u64).to_le_bytes());
        for position in &track.positions {
            hash.update(position.north_m.to_le_bytes());
            hash.update(position.east_m.to_le_bytes());
        }
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;
    use crate::geo::{Displacement, Position};
    use crate::track::VesselParticulars;

    fn tracks(speed_mps: f64) -> Vec<Track> {
        let way = Displacement::towards(Nautical::NORTH, speed_mps * 5.0);
        let positions = (0..240).map(|k| Position::ORIGIN + way * f64::from(k)).collect();
        vec![Track {
            mmsi: 7,
            start_unix_s: 0,
            dt_s: 5.0,
            positions,
            particulars: VesselParticulars::default(),
        }]
    }

    fn find(cache: &StartsCache, tracks: &[Track]) -> CachedStarts {
        cache.find(tracks, &HeadOnConfig::default())
    }

    fn files(folder: &Path) -> Vec<PathBuf> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn starts_are_found_once_for_the_same_tracks_and_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StartsCache::in_folder(folder.path().join("made/when/needed"));
        let first = find(&cache, &tracks(8.0));
        assert!(!first.was_cached && first.remark.is_none() && !first.starts.straight_on.is_empty());
        let second = find(&cache, &tracks(8.0));
        assert!(second.was_cached && second.starts == first.starts);
        assert!(!find(&cache, &tracks(9.0)).was_cached, "other tracks");
        let config = HeadOnConfig { spacing_s: 60.0, ..HeadOnConfig::default() };
        assert!(!cache.find(&tracks(8.0), &config).was_cached, "another configuration");
        assert_eq!(files(&folder.path().join("made/when/needed")).len(), 3);
    }

    #[test]
    fn a_damaged_or_foreign_file_is_not_believed() {
        let folder = tempfile::tempdir().unwrap();
        let cache = StartsCache::in_folder(folder.path().to_owned());
        let right = find(&cache, &tracks(8.0)).starts;
        let path = files(folder.path()).remove(0);
        let whole = fs::read(&path).unwrap();
        let text = String::from_utf8(whole.clone()).unwrap();
        let elsewhere = text.replace("\"index\":75", "\"index\":75000");
        assert_ne!(text, elsewhere);
        for bytes in [&whole[..whole.len() / 2], b"", elsewhere.as_bytes(), b"{\"key\":\"\",\"starts\":3}"] {
            fs::write(&path, bytes).unwrap();
            let found = find(&cache, &tracks(8.0));
            assert!(!found.was_cached && found.starts == right);
            assert!(
                found.remark.as_ref().is_some_and(|remark| remark.contains("found the starts anew")),
                "{found:?}"
            );
            assert_eq!(fs::read(&path).unwrap(), whole, "the file was replaced");
            assert!(find(&cache, &tracks(8.0)).was_cached);
        }
    }

    #[test]
    fn a_cache_that_cannot_be_written_is_remarked_and_does_no_harm() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let found = find(&StartsCache::in_folder(file.path().to_owned()), &tracks(8.0));
        assert_eq!(found.starts, find(&StartsCache::off(), &tracks(8.0)).starts);
        assert!(found.remark.is_some());
    }
}
