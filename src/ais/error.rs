//! What can end an import or the reading of its results.

use std::path::PathBuf;

use crate::atomic_file::WriteError;
use crate::config::ConfigError;

/// An import that could not be done at all. Single bad rows and files that break off are not
/// errors: they are in the [report](super::Report).
#[derive(Debug, thiserror::Error)]
pub enum AisError {
    /// No file was named.
    #[error("no AIS file given: name at least one CSV, .gz, .zst or .zip file")]
    NoFiles,
    /// A file could not be opened or its first line not be read.
    #[error("{file}:1: cannot be read ({source}): check the path, or fetch the file again if it is damaged")]
    Unreadable {
        /// The file as named by the caller.
        file: String,
        /// What the system or the decompressor said.
        source: std::io::Error,
    },
    /// A file without a single byte.
    #[error("{file}:1: is empty: expected a header line; fetch the file again or leave it out")]
    Empty {
        /// The file as named by the caller.
        file: String,
    },
    /// The first line is not the header of a known layout.
    #[error("{file}:1: {problem}: {remedy}")]
    UnknownHeader {
        /// The file as named by the caller.
        file: String,
        /// What the first line looks like instead.
        problem: String,
        /// What to do about it.
        remedy: String,
    },
    /// The area, threshold or mapping file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A result could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A folder of tracks does not hold what an import writes.
    #[error("{}:{line}: {problem}: import the tracks again with `searoom ais import`", file.display())]
    BadTracks {
        /// The file at fault.
        file: PathBuf,
        /// Its line, counted from 1.
        line: u64,
        /// What is wrong there.
        problem: String,
    },
}
