//! Results for people to read and for other programs: episodes as tables and as a replay, figures,
//! tables, curves.

pub mod episode_files;
pub mod event_file;
pub mod figure;
pub mod gallery;
pub mod map;
pub mod pictures;
pub mod replay;

use std::path::{Path, PathBuf};

use crate::atomic_file::WriteError;
use crate::episode::Episode;

/// The files of one episode.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EpisodeFiles {
    /// One row per step and vessel.
    pub csv: PathBuf,
    /// One JSON object per line.
    pub jsonl: PathBuf,
    /// The replay, a page that stands alone.
    pub html: PathBuf,
}

/// Writes `episode.csv`, `episode.jsonl` and `index.html` into `folder`, which is made where it is
/// missing. Each file appears whole or not at all.
///
/// # Errors
/// Where a file cannot be written.
pub fn write_episode(episode: &Episode, folder: &Path) -> Result<EpisodeFiles, WriteError> {
    Ok(EpisodeFiles {
        csv: episode_files::write_csv(episode, folder)?,
        jsonl: episode_files::write_jsonl(episode, folder)?,
        html: replay::write(episode, folder)?,
    })
}

/// Text as it has to stand in XML.
#[must_use]
pub fn xml_escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
