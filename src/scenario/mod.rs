//! Scripted encounters.

pub mod encounter_starts;
