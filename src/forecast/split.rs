//! Which part of the recorded tracks trains and which is held out: a split by time.
//!
//! The first part of the time span trains, the rest is held out, one split for forecasters and agents
//! alike. A track that straddles the boundary trains up to it and is not used after it, so that no
//! passage is known in part.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::config::BoundedNumber;
use crate::config::bounds::FRACTION;
use crate::track::Track;

/// Where the split lies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SplitConfig {
    /// Part of the time span, from the first to the last position of all tracks, that trains.
    pub train_fraction: f64,
}

impl SplitConfig {
    /// Its number and what it can be.
    pub(crate) fn numbers(&self) -> Vec<BoundedNumber> {
        vec![("train_fraction", self.train_fraction, FRACTION)]
    }
}

impl Default for SplitConfig {
    fn default() -> Self {
        Self { train_fraction: 0.7 }
    }
}

/// Tracks that train, and tracks that are held out.
#[derive(Debug, Clone, PartialEq)]
pub struct Split {
    /// Tracks, or the parts of them, that end before [`Self::boundary_unix_s`].
    pub train: Vec<Track>,
    /// Tracks that start at or after it.
    pub test: Vec<Track>,
    /// Start of the held-out time, in seconds since 1970.
    pub boundary_unix_s: f64,
    /// Tracks cut at the boundary; their later part is in neither set.
    pub straddling: usize,
}

impl Split {
    /// The vessels among the training tracks.
    #[must_use]
    pub fn trained_vessels(&self) -> BTreeSet<u32> {
        self.train.iter().map(|track| track.mmsi).collect()
    }
}

/// Why tracks cannot be split.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SplitError {
    /// No track to split.
    #[error("there are no tracks to split into training and test; check the area's filters and its report")]
    NoTracks,
    /// A share that leaves one side empty.
    #[error("`train_fraction` is {0}; it has to lie between 0 and 1, both excluded")]
    Fraction(f64),
}

/// Splits tracks by time.
///
/// # Errors
///
/// When there are no tracks or `train_fraction` is not between 0 and 1.
pub fn split_by_time(tracks: &[Track], config: &SplitConfig) -> Result<Split, SplitError> {
    if !(config.train_fraction > 0.0 && config.train_fraction < 1.0) {
        return Err(SplitError::Fraction(config.train_fraction));
    }
    if tracks.is_empty() {
        return Err(SplitError::NoTracks);
    }
    let first = tracks.iter().map(|track| track.unix_s(0)).fold(f64::INFINITY, f64::min);
    let last = tracks.iter().map(end_unix_s).fold(f64::NEG_INFINITY, f64::max);
    let boundary_unix_s = first + config.train_fraction * (last - first);

    let mut split = Split { train: Vec::new(), test: Vec::new(), boundary_unix_s, straddling: 0 };
    for track in tracks {
        if track.unix_s(0) >= boundary_unix_s {
            split.test.push(track.clone());
        } else if end_unix_s(track) < boundary_unix_s {
            split.train.push(track.clone());
        } else {
            split.straddling += 1;
            let mut before = track.clone();
            before.positions.truncate(positions_before(track, boundary_unix_s));
            if before.positions.len() >= 2 {
                split.train.push(before);
            }
        }
    }
    Ok(split)
}

fn end_unix_s(track: &Track) -> f64 {
    track.unix_s(track.positions.len() - 1)
}

fn positions_before(track: &Track, boundary_unix_s: f64) -> usize {
    ((boundary_unix_s - track.unix_s(0)) / track.dt_s).ceil() as usize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geo::Position;
    use crate::track::VesselParticulars;

    fn track(mmsi: u32, start_unix_s: i64, positions: usize) -> Track {
        let positions =
            (0..positions).map(|k| Position { north_m: start_unix_s as f64, east_m: k as f64 }).collect();
        Track { mmsi, start_unix_s, dt_s: 5.0, positions, particulars: VesselParticulars::default() }
    }

    #[test]
    fn a_straddling_track_trains_up_to_the_boundary_and_is_dropped_after_it() {
        let split = split_by_time(&[track(1, 0, 11), track(2, 30, 15)], &SplitConfig { train_fraction: 0.6 })
            .unwrap();
        assert_eq!((split.boundary_unix_s, split.straddling), (60.0, 1));
        assert_eq!(split.train[1].positions.len(), 6);
        assert!(split.test.is_empty());
    }

    #[test]
    fn impossible_splits_are_refused() {
        assert_eq!(split_by_time(&[], &SplitConfig::default()), Err(SplitError::NoTracks));
        for train_fraction in [0.0, 1.0, f64::NAN] {
            let refused = split_by_time(&[track(1, 0, 3)], &SplitConfig { train_fraction });
            assert!(matches!(refused, Err(SplitError::Fraction(_))));
        }
    }

    proptest! {
        /// The proof that held-out tracks never touch training: in time no position of one set lies on
        /// the other's side, and every position is in at most one of them.
        #[test]
        fn training_and_test_never_meet(
            spans in prop::collection::vec((0..20_000_i64, 2..400_usize), 1..30),
            train_fraction in 0.05..0.95_f64,
        ) {
            let tracks: Vec<Track> =
                spans.iter().enumerate().map(|(k, &(start, n))| track(k as u32, start, n)).collect();
            let split = split_by_time(&tracks, &SplitConfig { train_fraction }).unwrap();
            for trained in &split.train {
                prop_assert!(end_unix_s(trained) < split.boundary_unix_s);
                prop_assert!(split.test.iter().all(|held_out| held_out.mmsi != trained.mmsi));
            }
            for held_out in &split.test {
                prop_assert!(held_out.unix_s(0) >= split.boundary_unix_s);
                prop_assert_eq!(held_out, &tracks[held_out.mmsi as usize]);
            }
        }
    }
}
