//! What is done already: one file per cell, so that an interrupted benchmark goes on where it was.
//!
//! A file is named after everything that its content follows from: the program itself, settings, tracks, weights.
//! Whatever differs in any of them is simply not found. The files go once the results are written.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::field::Field;
use super::recordings::Recordings;
use crate::atomic_file;
use crate::experiment::noise::{Cell, Group, NoiseConfig, ThinnedPath};

/// Name of the folder within that of the results.
const FOLDER: &str = "unfinished";

/// The files of one benchmark.
pub(super) struct Ledger {
    folder: PathBuf,
    /// Of program, settings, tracks and weights.
    fingerprint: u64,
}

impl Ledger {
    pub(super) fn open(
        out: &Path,
        config: &NoiseConfig,
        recordings: &Recordings,
        field: &Field,
    ) -> anyhow::Result<Self> {
        let mut hasher = DefaultHasher::new();
        let program = std::env::current_exe().context("cannot tell which program this is")?;
        hash_file(&program, &mut hasher)?;
        // Which noises and scenarios are asked for does not matter to a cell of one of them.
        let common = NoiseConfig { sigmas_m: Vec::new(), scenario: Default::default(), ..config.clone() };
        serde_json::to_string(&common)?.hash(&mut hasher);
        for waters in &recordings.waters {
            serde_json::to_string(waters.traffic.starts())?.hash(&mut hasher);
            waters.traffic.tracks().for_each(|track| {
                (track.mmsi, track.start_unix_s, track.dt_s.to_bits()).hash(&mut hasher);
                let bits =
                    |position: &crate::geo::Position| (position.north_m.to_bits(), position.east_m.to_bits());
                track.positions.iter().for_each(|position| bits(position).hash(&mut hasher));
            });
        }
        for (file, _) in field.forecasters.iter() {
            hash_file(file, &mut hasher)?;
        }
        Ok(Self { folder: out.join(FOLDER), fingerprint: hasher.finish() })
    }

    fn file(&self, group: &Group<'_>, name: &str, key: u64) -> PathBuf {
        let mut hasher = DefaultHasher::new();
        (self.fingerprint, group.waters.part, group.kind, group.sigma_m.to_bits(), name, key)
            .hash(&mut hasher);
        self.folder.join(format!("{:016x}.json", hasher.finish()))
    }

    /// A finished cell; `key` is the contestant's fingerprint.
    pub(super) fn cell(&self, group: &Group<'_>, policy: &str, key: u64) -> Option<Cell> {
        read(&self.file(group, policy, key))
    }

    /// Keeps a finished cell.
    pub(super) fn save(&self, group: &Group<'_>, key: u64, cell: &Cell) -> anyhow::Result<()> {
        write(&self.file(group, &cell.policy, key), cell)
    }

    /// The forecasts of a group, for replays.
    pub(super) fn paths(&self, group: &Group<'_>) -> Option<Vec<ThinnedPath>> {
        read(&self.file(group, "forecasts", 0))
    }

    /// Keeps the forecasts of a group.
    pub(super) fn save_paths(&self, group: &Group<'_>, paths: &[ThinnedPath]) -> anyhow::Result<()> {
        write(&self.file(group, "forecasts", 0), paths)
    }

    /// Everything is written elsewhere: the files can go.
    pub(super) fn remove(&self) -> anyhow::Result<()> {
        match fs::remove_dir_all(&self.folder) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(error).with_context(|| format!("{}: cannot be removed", self.folder.display()))
            }
            _ => Ok(()),
        }
    }
}

/// The fingerprint of a file and what belongs to it.
pub(super) fn fingerprint(file: &Path, with: &str) -> anyhow::Result<u64> {
    let mut hasher = DefaultHasher::new();
    hash_file(file, &mut hasher)?;
    with.hash(&mut hasher);
    Ok(hasher.finish())
}

fn hash_file(file: &Path, hasher: &mut DefaultHasher) -> anyhow::Result<()> {
    let bytes = fs::read(file).with_context(|| format!("{}: cannot be read", file.display()))?;
    bytes.hash(hasher);
    Ok(())
}

/// A file that is missing or damaged was never finished.
fn read<T: DeserializeOwned>(file: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

fn write<T: Serialize + ?Sized>(file: &Path, content: &T) -> anyhow::Result<()> {
    atomic_file::write(file, |out| Ok(serde_json::to_writer(out, content)?))?;
    Ok(())
}
