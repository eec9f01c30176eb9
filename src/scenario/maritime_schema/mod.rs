//! Traffic situations in DNV's maritime-schema JSON: own ship with waypoints, target ships, and the speed
//! of each leg.
//!
//! Written is version 0.2.0 of the schema (2026-03-05, <https://github.com/dnv-opensource/maritime-schema>,
//! `schemas/traffic_situation.json`); read are its older forms, too, as ship-traffic-generator and the
//! schema's own examples show them:
//!
//! | quirk | how it is read |
//! | --- | --- |
//! | `version` missing, or that of the program that wrote the file | it decides nothing |
//! | `lat`, `lon`, or `latitude`, `longitude` | alike |
//! | `static.dimensions.length`, or `static.length` | alike |
//! | `null` | as if the key were not there |
//! | `leg` of a waypoint | the leg that **ends** at it; `leg.data.sog` before `leg.sog` |
//! | `data` of a waypoint, or of its position (before 0.1.0) | the leg that **begins** at it |
//! | `targetShips` missing | none |
//! | no `waypoints` (before 0.2.0), or none apart from the start | straight on from `initial` |
//! | no `initial` (0.2.0) | at the first waypoint, on the course of its first leg |
//! | first waypoint apart from `initial.position` | a leg leads there at the initial speed |
//! | a leg without a speed | that of the leg before, the first one the initial speed |
//! | positions with `north` and `east` beside radians (ship-traffic-generator before 0.3.0) | refused |
//!
//! Speeds are knots over ground, directions degrees from north; wind is in metres per second and blows
//! **from** its direction, the current sets **towards** it. What a scenario cannot hold is left out and
//! listed.

mod export;
mod import;
mod node;

pub use export::{ExportError, export};
pub use import::{Import, ImportOptions, import};

/// The version of the schema that is written.
pub const VERSION: &str = "0.2.0";
/// The navigational status of a ship that moves, and of one that does not.
const UNDER_WAY: &str = "Under way using engine";
const AT_ANCHOR: &str = "At anchor";

#[cfg(test)]
mod tests;
