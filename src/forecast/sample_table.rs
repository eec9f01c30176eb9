//! Forecasts of many samples of recorded tracks, made once in large batches and kept in a file.
//!
//! Where histories are free of noise, a forecast depends on the track and the sample alone. Agents that train
//! in one area ask for the same ones over and over, run after run.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::{Basis, ForecastError, Forecaster, Forecasts};
use crate::atomic_file::{self, WriteError};
use crate::geo::{Displacement, Position};
use crate::track::Track;

/// A sample of a track: index of the track, index of the position on it.
pub type Sample = (usize, usize);

/// Forecasts by sample.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleTable {
    rows: HashMap<Sample, usize>,
    steps: usize,
    /// From the sample to each position that follows, `[rows][steps][2]` in metres, north before east.
    offsets: Vec<f32>,
    bases: Vec<Basis>,
}

/// `there` as a table keeps it, seen from the sample at `here`: to a millimetre within some ten kilometres.
#[must_use]
pub fn as_kept(here: Position, there: Position) -> Position {
    from_offset(here, offset(here, there))
}

fn offset(here: Position, there: Position) -> [f32; 2] {
    let way = there - here;
    [way.north_m as f32, way.east_m as f32]
}

fn from_offset(here: Position, way: [f32; 2]) -> Position {
    here + Displacement { north_m: f64::from(way[0]), east_m: f64::from(way[1]) }
}

/// Histories that are forecast at once.
const BATCH: usize = 64;

impl SampleTable {
    /// Forecasts `steps` positions after each of `samples`; `forecaster` reads the track up to there.
    /// `on_progress` hears how many are done.
    ///
    /// # Errors
    ///
    /// When a history has fewer than two finite positions.
    pub fn forecast(
        forecaster: &mut dyn Forecaster,
        tracks: &[&Track],
        samples: &BTreeSet<Sample>,
        steps: usize,
        on_progress: &mut dyn FnMut(usize),
    ) -> Result<Self, ForecastError> {
        let samples: Vec<Sample> = samples.iter().copied().collect();
        let mut table = Self::empty(&samples, steps);
        let mut forecasts = Forecasts::new();
        for batch in samples.chunks(BATCH) {
            let histories: Vec<&[Position]> = batch
                .iter()
                .map(|&(track, index)| {
                    let first = (index + 1).saturating_sub(forecaster.history_len());
                    &tracks[track].positions[first..=index]
                })
                .collect();
            forecaster.forecast(&histories, steps, &mut forecasts)?;
            for (path, &(track, index)) in batch.iter().enumerate() {
                let here = tracks[track].positions[index];
                table.offsets.extend(forecasts.path(path).iter().flat_map(|&there| offset(here, there)));
                table.bases.push(forecasts.basis(path));
            }
            on_progress(batch.len());
        }
        Ok(table)
    }

    fn empty(samples: &[Sample], steps: usize) -> Self {
        let rows = samples.iter().enumerate().map(|(row, &sample)| (sample, row)).collect();
        let offsets = Vec::with_capacity(samples.len() * steps * 2);
        Self { rows, steps, offsets, bases: Vec::with_capacity(samples.len()) }
    }

    /// Samples that are forecast.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The positions that follow a sample at `here`, and what they rest on.
    #[must_use]
    pub fn path(&self, sample: Sample, here: Position) -> Option<(Vec<Position>, Basis)> {
        let row = *self.rows.get(&sample)?;
        let offsets = &self.offsets[row * self.steps * 2..(row + 1) * self.steps * 2];
        let at =
            |way: &[f32; 2]| here + Displacement { north_m: f64::from(way[0]), east_m: f64::from(way[1]) };
        Some((offsets.as_chunks::<2>().0.iter().map(at).collect(), self.bases[row]))
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut samples: Vec<(&Sample, &usize)> = self.rows.iter().collect();
        samples.sort_unstable_by_key(|&(_, row)| row);
        let mut bytes = Vec::with_capacity(self.offsets.len() * 4 + samples.len() * 17);
        for (&(track, index), &row) in samples {
            bytes.extend((track as u64).to_le_bytes());
            bytes.extend((index as u64).to_le_bytes());
            bytes.push(self.bases[row] as u8);
        }
        bytes.extend(self.offsets.iter().flat_map(|offset| offset.to_le_bytes()));
        bytes
    }

    /// What [`Self::to_bytes`] wrote of `samples`; nothing where it is of others.
    fn from_bytes(bytes: &[u8], samples: &BTreeSet<Sample>, steps: usize) -> Option<Self> {
        let samples: Vec<Sample> = samples.iter().copied().collect();
        let (heads, offsets) = bytes.split_at_checked(samples.len() * 17)?;
        if offsets.len() != samples.len() * steps * 8 {
            return None;
        }
        let mut table = Self::empty(&samples, steps);
        for (head, &(track, index)) in heads.as_chunks::<17>().0.iter().zip(&samples) {
            let number = |at: usize| head[at..at + 8].try_into().ok().map(u64::from_le_bytes);
            if (number(0)?, number(8)?) != (track as u64, index as u64) {
                return None;
            }
            table.bases.push([Basis::Model, Basis::TooShort, Basis::Gap].into_iter().nth(head[16].into())?);
        }
        table.offsets.extend(offsets.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)));
        table.offsets.iter().all(|offset| offset.is_finite()).then_some(table)
    }
}

/// A file that keeps a table, named after everything that its forecasts follow from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableFile(PathBuf);

impl TableFile {
    /// In `folder`, for the forecasts of a model (its file's bytes) after `samples` of `tracks`.
    #[must_use]
    pub fn of(
        folder: &Path,
        model: &[u8],
        tracks: &[&Track],
        samples: &BTreeSet<Sample>,
        steps: usize,
    ) -> Self {
        let mut hash = Sha256::new();
        hash.update(model);
        hash.update((steps as u64).to_le_bytes());
        for &(track, index) in samples {
            hash.update((track as u64).to_le_bytes());
            hash.update((index as u64).to_le_bytes());
        }
        for track in tracks {
            hash.update(track.dt_s.to_le_bytes());
            hash.update((track.positions.len() as u64).to_le_bytes());
            for position in &track.positions {
                hash.update(position.north_m.to_le_bytes());
                hash.update(position.east_m.to_le_bytes());
            }
        }
        let key: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Self(folder.join(format!("forecasts-{key}.bin")))
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The table that the file keeps; nothing where there is no file, or a damaged one, which is then made
    /// anew.
    #[must_use]
    pub fn read(&self, samples: &BTreeSet<Sample>, steps: usize) -> Option<SampleTable> {
        let bytes = fs::read(&self.0).ok()?;
        let (content, checksum) = bytes.split_at_checked(bytes.len().checked_sub(32)?)?;
        let is_whole = Sha256::digest(content).as_slice() == checksum;
        is_whole.then(|| SampleTable::from_bytes(content, samples, steps)).flatten()
    }

    /// Keeps a table.
    ///
    /// # Errors
    ///
    /// When the file cannot be written.
    pub fn write(&self, table: &SampleTable) -> Result<(), WriteError> {
        let content = table.to_bytes();
        atomic_file::write(&self.0, |file| {
            file.write_all(&content)?;
            file.write_all(&Sha256::digest(&content))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::LinearForecaster;
    use super::*;
    use crate::track::VesselParticulars;

    fn track(north_m: f64) -> Track {
        let positions = (0..100).map(|k| Position { north_m: north_m * f64::from(k), east_m: 0.1 }).collect();
        Track { mmsi: 1, start_unix_s: 0, dt_s: 5.0, positions, particulars: VesselParticulars::default() }
    }

    fn table(tracks: &[&Track], samples: &BTreeSet<Sample>) -> SampleTable {
        let mut done = 0;
        let forecaster = &mut LinearForecaster::over(10);
        let table = SampleTable::forecast(forecaster, tracks, samples, 20, &mut |n| done += n).unwrap();
        assert_eq!(done, samples.len());
        table
    }

    #[test]
    fn a_table_answers_as_its_forecaster() {
        let (slow, fast) = (track(10.0), track(40.0));
        let samples = BTreeSet::from([(0, 30), (1, 30), (1, 99)]);
        let table = table(&[&slow, &fast], &samples);
        let (path, basis) = table.path((1, 30), fast.positions[30]).unwrap();
        assert_eq!((path.len(), basis), (20, Basis::Model));
        assert!((path[19].north_m - 40.0 * 50.0).abs() < 1e-3, "{:?}", path[19]);
        assert_eq!(table.path((0, 31), slow.positions[31]), None);
    }

    #[test]
    fn a_table_survives_its_file_and_a_damaged_one_is_not_believed() {
        let folder = tempfile::tempdir().unwrap();
        let track = track(10.0);
        let samples = BTreeSet::from([(0, 30), (0, 40), (0, 2)]);
        let table = table(&[&track], &samples);
        let file = TableFile::of(folder.path(), b"model", &[&track], &samples, 20);
        assert_eq!(file.read(&samples, 20), None);
        file.write(&table).unwrap();
        assert_eq!(file.read(&samples, 20), Some(table));
        assert_eq!(file.read(&BTreeSet::from([(0, 30), (0, 40), (0, 3)]), 20), None);

        let other = TableFile::of(folder.path(), b"other model", &[&track], &samples, 20);
        assert_ne!(file.path(), other.path());
        let mut bytes = fs::read(file.path()).unwrap();
        bytes[70] ^= 1;
        fs::write(file.path(), &bytes).unwrap();
        assert_eq!(file.read(&samples, 20), None);
        fs::write(file.path(), &bytes[..40]).unwrap();
        assert_eq!(file.read(&samples, 20), None);
    }
}
