//! The segments a model trains on and is measured on.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::bail;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::cli::recorded;
use crate::forecast::dataset::{RecordedConfig, RecordedSegments, SegmentSource, SyntheticSegments};
use crate::forecast::{DataConfig, ModelConfig, Segment, split_by_time};
use crate::geo::{Geodetic, Position};

/// Segments to learn from.
pub(super) struct Training {
    pub source: Box<dyn SegmentSource>,
    /// Origin of the plane of recorded tracks.
    pub origin: Option<Geodetic>,
}

/// Segments to be measured on.
pub(super) struct HeldOut {
    pub segments: Vec<Segment>,
    /// Vessels that training has seen.
    pub seen: BTreeSet<u32>,
}

/// Recorded tracks to be measured on instead of the model's own: an area that training never saw.
#[derive(Debug, Clone, clap::Args)]
pub(in crate::cli) struct OtherArea {
    /// Measure on another area (TOML), all of its tracks; needs --ais.
    #[arg(long, requires = "ais")]
    area: Option<PathBuf>,
    /// AIS files of that area.
    #[arg(long, num_args = 1.., requires = "area")]
    ais: Vec<PathBuf>,
}

impl OtherArea {
    /// The model's own data.
    pub const NONE: Self = Self { area: None, ais: Vec::new() };

    /// The area file, where another area was asked for.
    pub fn area(&self) -> Option<&Path> {
        self.area.as_deref()
    }
}

pub(super) fn training_source(config: &ModelConfig) -> anyhow::Result<Training> {
    let history_len = config.kind.history_len();
    let horizon = config.training.most_calls() * config.kind.outputs();
    match &config.data {
        DataConfig::Synthetic { process, segments } => Ok(Training {
            source: Box::new(SyntheticSegments {
                process: *process,
                config: *segments,
                history_len,
                horizon,
            }),
            origin: None,
        }),
        DataConfig::Recorded { area, files, split, segments, .. } => {
            let recorded = recorded::import(Path::new(area), files.iter().map(Path::new))?;
            let split = split_by_time(&recorded.tracks, split)?;
            let source = RecordedSegments::new(split.train, history_len, horizon, *segments)?;
            Ok(Training { source: Box::new(source), origin: Some(recorded.origin) })
        }
    }
}

/// `count` segments of the model's own held-out data, or of another area.
pub(super) fn held_out(
    config: &ModelConfig,
    other: &OtherArea,
    horizon: usize,
    count: usize,
    seed: u64,
) -> anyhow::Result<HeldOut> {
    let history_len = config.kind.history_len();
    if let Some(area) = &other.area {
        let recorded = recorded::import(area, other.ais.iter().map(PathBuf::as_path))?;
        let all = RecordedSegments::new(recorded.tracks, history_len, horizon, RecordedConfig::default())?;
        return Ok(HeldOut { segments: all.spread(count), seen: BTreeSet::new() });
    }
    match &config.data {
        DataConfig::Synthetic { process, segments } => {
            let source = SyntheticSegments { process: *process, config: *segments, history_len, horizon };
            let segments = source.take(count, &mut held_out_stream(seed));
            Ok(HeldOut { segments, seen: BTreeSet::new() })
        }
        DataConfig::Recorded { area, files, split, segments, .. } => {
            let recorded = recorded::import(Path::new(area), files.iter().map(Path::new))?;
            let split = split_by_time(&recorded.tracks, split)?;
            let seen = split.trained_vessels();
            let held_out = RecordedSegments::new(split.test, history_len, horizon, *segments)?;
            Ok(HeldOut { segments: held_out.spread(count), seen })
        }
    }
}

/// One held-out path of a model's own process.
pub(super) fn synthetic_path(
    config: &ModelConfig,
    length: usize,
    seed: u64,
) -> anyhow::Result<Vec<Position>> {
    let DataConfig::Synthetic { process, segments } = &config.data else {
        bail!("{} was trained on recorded tracks; this figure shows a synthetic motion", config.name);
    };
    let source = SyntheticSegments { process: *process, config: *segments, history_len: length, horizon: 0 };
    Ok(source.draw(&mut held_out_stream(seed)).history)
}

/// A stream of random numbers that no training draws from: trainers use streams 0 and 1 of their seeds.
fn held_out_stream(seed: u64) -> ChaCha8Rng {
    const HELD_OUT_STREAM: u64 = 2;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(HELD_OUT_STREAM);
    rng
}
