//! Scripted encounters: from a TOML file or a Rust program to ships that move.
//!
//! A [`ScenarioFile`] is parsed and checked key by key; whatever is wrong is an error that names
//! file, line and key and says what to write instead. A [`Scenario`] is the same without a file, for
//! programs. Recorded tracks are looked up, targets are placed relative to own ship
//! ([`placement`]), and the starts of the paper's head-on encounters are found on recorded tracks
//! ([`encounter_starts`]).

pub mod drawn;
mod dynamics;
pub mod encounter_starts;
mod file;
pub mod foresight;
pub mod imazu;
pub mod maritime_schema;
mod model;
mod moment;
mod parse;
pub mod placement;
mod run;
mod section;
mod setup;
pub mod starts_cache;
pub mod streams;
mod tracks;
mod write;

pub use crate::config::Fault;
pub use file::ScenarioFile;
pub use foresight::ForecasterChoice;
pub use model::*;
pub use setup::{PlacedTarget, StagedEncounter};
