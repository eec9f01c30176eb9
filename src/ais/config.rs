//! The thresholds of an import.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, Source};

/// Thresholds of reading, cleaning, splitting and resampling; every one a TOML key.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImportConfig {
    /// Time between two positions of a track, a whole number of seconds.
    pub dt_s: u32,
    /// A longer time without a message ends a trajectory (after Paulig & Okhrin).
    pub max_gap_s: f64,
    /// No vessel is faster: an implied speed above it is a jump.
    pub max_speed_mps: f64,
    /// Acceleration with which a vessel may reach beyond what its last speed explains, in m/s^2.
    pub max_acceleration_mps2: f64,
    /// Scatter of positions that is never held against a fix, in metres.
    pub position_slack_m: f64,
    /// A position told again is stale if the reported speed has carried the vessel this far since.
    pub stale_distance_m: f64,
    /// How many times the speed around it a fix may imply before it is a spike.
    pub spike_factor: f64,
    /// Speed that is added to that bound, so that vessels at rest may start.
    pub spike_floor_mps: f64,
    /// A stray with at most this many fixes beside a longer trajectory of the same vessel is made
    /// of spikes; a longer one is a second vessel.
    pub max_stray_fixes: usize,
    /// A vessel within this distance ...
    pub moored_radius_m: f64,
    /// ... for this long is moored or at anchor; its trajectory is cut there.
    pub moored_duration_s: f64,
    /// A trajectory within a box of this diagonal is that of a moored or anchored vessel.
    pub moored_extent_m: f64,
    /// Shorter trajectories are left out.
    pub min_duration_s: f64,
    /// Trajectories with fewer fixes are left out.
    pub min_fixes: usize,
    /// How many times the speeds around an interval the spline may reach in it before a
    /// shape-preserving cubic takes its place.
    pub spline_speed_factor: f64,
    /// Speed that is added to that bound.
    pub spline_speed_floor_mps: f64,
    /// How far the spline may bow out from the straight line between two fixes, as a part of the
    /// distance between them ...
    pub spline_bow_factor: f64,
    /// ... plus this many metres.
    pub spline_bow_slack_m: f64,
    /// A longer line is one bad row.
    pub max_line_bytes: usize,
    /// A compressed file that grows by more than this factor is taken for a decompression bomb ...
    pub max_expansion: u64,
    /// ... once it has grown to this many bytes.
    pub expansion_checked_from_bytes: u64,
    /// Bad rows listed one by one; all are counted.
    pub max_bad_rows_listed: usize,
    /// Numbers of nine digits that are typed in when nobody set the real MMSI.
    pub placeholder_mmsi: Vec<u32>,
}

impl Default for ImportConfig {
    fn default() -> Self {
        Self {
            dt_s: 5,
            max_gap_s: 371.0,
            max_speed_mps: 30.0,
            max_acceleration_mps2: 0.5,
            position_slack_m: 30.0,
            stale_distance_m: 10.0,
            spike_factor: 2.0,
            spike_floor_mps: 2.0,
            max_stray_fixes: 3,
            moored_radius_m: 100.0,
            moored_duration_s: 900.0,
            moored_extent_m: 500.0,
            min_duration_s: 600.0,
            min_fixes: 8,
            spline_speed_factor: 1.5,
            spline_speed_floor_mps: 0.5,
            spline_bow_factor: 0.5,
            spline_bow_slack_m: 5.0,
            max_line_bytes: 1 << 20,
            max_expansion: 200,
            expansion_checked_from_bytes: 64 << 20,
            max_bad_rows_listed: 10_000,
            placeholder_mmsi: vec![123_456_789, 987_654_321],
        }
    }
}

impl ImportConfig {
    /// Reads thresholds from a TOML file; keys that are left out keep their defaults.
    ///
    /// # Errors
    /// With file, line, key and remedy where it is missing, has unknown keys, or a value cannot be.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let source = Source::read(path)?;
        let config: Self = source.parse()?;
        config.check().map_err(|(key, remedy)| {
            let at = source.text.find(key).unwrap_or(0);
            source.error_at(at..at, key, "is out of range", remedy)
        })?;
        Ok(config)
    }

    /// The first value that cannot be, with what to do about it.
    fn check(&self) -> Result<(), (&'static str, &'static str)> {
        if self.dt_s == 0 {
            return Err(("dt_s", "give a whole number of seconds above zero"));
        }
        let non_negative = [
            ("max_gap_s", self.max_gap_s),
            ("max_speed_mps", self.max_speed_mps),
            ("max_acceleration_mps2", self.max_acceleration_mps2),
            ("position_slack_m", self.position_slack_m),
            ("stale_distance_m", self.stale_distance_m),
            ("spike_factor", self.spike_factor),
            ("spike_floor_mps", self.spike_floor_mps),
            ("moored_radius_m", self.moored_radius_m),
            ("moored_duration_s", self.moored_duration_s),
            ("moored_extent_m", self.moored_extent_m),
            ("min_duration_s", self.min_duration_s),
            ("spline_speed_factor", self.spline_speed_factor),
            ("spline_speed_floor_mps", self.spline_speed_floor_mps),
            ("spline_bow_factor", self.spline_bow_factor),
            ("spline_bow_slack_m", self.spline_bow_slack_m),
        ];
        match non_negative.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
            Some((key, _)) => Err((key, "give a finite number that is not negative")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_that_cannot_be_are_refused_with_their_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("thresholds.toml");
        for (text, expected) in [
            ("\ndt_s = 0\n", "thresholds.toml:2: key \"dt_s\": is out of range"),
            ("max_gap_s = -1.0\n", "thresholds.toml:1: key \"max_gap_s\""),
            ("max_speed_mps = nan\n", "give a finite number"),
            ("max_gap = 3.0\n", "did you mean \"max_gap_s\"?"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = ImportConfig::load(&path).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        std::fs::write(&path, "max_gap_s = 100.0\n").unwrap();
        let config = ImportConfig::load(&path).unwrap();
        assert_eq!(config, ImportConfig { max_gap_s: 100.0, ..ImportConfig::default() });
    }
}
