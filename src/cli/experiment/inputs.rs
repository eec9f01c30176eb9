//! What figures are made from, and what to do where it is missing.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args as ClapArgs;

use super::runs::{self, LOG};
use crate::ais::Area;
use crate::cli::forecast::data::OtherArea;
use crate::cli::forecast::figures;
use crate::cli::recorded;
use crate::env::coastal::{Coastal, CoastalConfig, Opening, RecordedTraffic};
use crate::env::{Env, SeedDomain};
use crate::experiment::curves::{Curve, Waters};
use crate::experiment::estimator_training::TrainingLog;
use crate::experiment::noise_analysis::NoiseRow;
use crate::forecast::{DataConfig, LstmForecaster, split_by_time};
use crate::geo::LocalPlane;
use crate::scenario::encounter_starts::HeadOnKind;
use crate::track::Track;

/// Where to look.
#[derive(Debug, Clone, ClapArgs)]
pub(super) struct InputArgs {
    /// Your own runs, instead of the shipped results and models
    #[arg(long, value_name = "DIR")]
    pub runs: Option<PathBuf>,
    /// Folder of the shipped results
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Folder of the shipped models
    #[arg(long, value_name = "DIR", default_value = "models")]
    pub models: PathBuf,
    /// What `searoom benchmark noise --json` printed [default: noise_analysis.json in the folder of results]
    #[arg(long, value_name = "FILE")]
    pub noise: Option<PathBuf>,
    /// Held-out segments to measure forecasts on
    #[arg(long, default_value_t = 2000)]
    pub segments: usize,
    /// Number of the benchmark episode, or of the synthetic path, that is shown
    #[arg(long, default_value_t = 0)]
    pub episode: u64,
}

/// The recorded tracks of a model's area.
pub(super) struct Recorded {
    pub tracks: Vec<Track>,
    pub plane: LocalPlane,
    pub area: Area,
}

/// Held-out tracks, and an episode on them of each scenario.
pub(super) struct Situations {
    pub tracks: Vec<Track>,
    /// Number among the benchmark episodes, and how it starts.
    pub openings: Vec<(u64, Opening)>,
}

/// Scenarios are looked for in this many episodes: they come with equal probability.
const EPISODES_SEARCHED: u64 = 1000;

impl InputArgs {
    /// The seed of the episode that is shown.
    pub fn seed(&self) -> u64 {
        SeedDomain::Benchmark.seed(self.episode)
    }

    /// The file of a forecaster: of the user's run, where there is one of that name.
    pub fn forecaster_file(&self, name: &str) -> anyhow::Result<PathBuf> {
        let own = self.runs.as_ref().map(|runs| runs.join(name).join("model.safetensors"));
        let file = match own {
            Some(own) if own.is_file() => own,
            _ => self.models.join(format!("{name}.safetensors")),
        };
        ensure!(
            file.is_file(),
            "{}: this figure needs a forecaster; train it with: searoom forecast train --config \
             models/training/{}.toml --out {}",
            file.display(),
            name.trim_start_matches("open-water-").trim_end_matches("-ny-lower-bay"),
            self.runs.as_deref().unwrap_or(Path::new("runs")).join(name).display()
        );
        Ok(file)
    }

    pub fn open_water_files(&self, waters: &[Waters]) -> anyhow::Result<Vec<PathBuf>> {
        waters.iter().map(|waters| self.forecaster_file(waters.slug())).collect()
    }

    pub fn coastal_file(&self) -> anyhow::Result<PathBuf> {
        self.forecaster_file("coastal-ny-lower-bay")
    }

    /// The tracks that a forecaster was trained and is tested on.
    pub fn recorded(&self, forecaster: &LstmForecaster) -> anyhow::Result<Recorded> {
        let config = &forecaster.model().config;
        let DataConfig::Recorded { area, files, .. } = &config.data else {
            bail!("{} was not trained on recorded tracks; this figure shows some", config.name);
        };
        let area = Path::new(area);
        let recorded = recorded::import(area, files.iter().map(Path::new))?;
        Ok(Recorded {
            tracks: recorded.tracks,
            plane: LocalPlane::at(recorded.origin),
            area: Area::load(area)?,
        })
    }

    /// The held-out tracks, and the first benchmark episode on them of each scenario.
    pub fn situations(
        &self,
        forecaster: &LstmForecaster,
        config: &CoastalConfig,
    ) -> anyhow::Result<Situations> {
        let DataConfig::Recorded { split, .. } = &forecaster.model().config.data else {
            bail!("{} was not trained on recorded tracks", forecaster.model().config.name);
        };
        let held_out = split_by_time(&self.recorded(forecaster)?.tracks, split)?.test;
        let traffic = RecordedTraffic::new(held_out.clone(), config)?;
        let mut env = Coastal::new(config.clone(), traffic.into(), None)?;
        let mut observation = vec![0.0; env.observation_len()];
        let mut first = |kind: HeadOnKind| -> anyhow::Result<(u64, Opening)> {
            for episode in self.episode..self.episode + EPISODES_SEARCHED {
                env.reset(SeedDomain::Benchmark.seed(episode), &mut observation);
                if let Some(opening) = env.opening().filter(|opening| opening.kind == kind) {
                    return Ok((episode, opening.clone()));
                }
            }
            bail!(
                "none of {EPISODES_SEARCHED} episodes from number {} on is of scenario {kind:?}",
                self.episode
            )
        };
        let openings = vec![first(HeadOnKind::BeforeCurve)?, first(HeadOnKind::StraightOn)?];
        Ok(Situations { tracks: held_out, openings })
    }

    /// All learning curves there are.
    pub fn curves(&self) -> anyhow::Result<Vec<Curve>> {
        runs::curves(self.curve_folder())
    }

    /// Where learning curves are looked for.
    pub fn curve_folder(&self) -> &Path {
        self.runs.as_deref().unwrap_or(&self.results)
    }

    /// The logs of the open-water forecasters' trainings, of those there are.
    pub fn training_logs(&self) -> anyhow::Result<Vec<TrainingLog>> {
        let folder = self.curve_folder();
        let runs = [Waters::Stochastic, Waters::Periodic].map(|waters| folder.join(waters.slug()));
        let there = runs.iter().filter(|run| run.join(LOG).is_file());
        let logs: Vec<TrainingLog> =
            there.map(|run| runs::training_log(run)).collect::<anyhow::Result<_>>()?;
        ensure!(
            !logs.is_empty(),
            "{} and {}: no log of a forecaster's training; make them with --from-scratch, or with searoom forecast train \
             --config models/training/NAME.toml --out runs/open-water-MOTION and searoom experiment collect",
            runs[0].join(LOG).display(),
            runs[1].join(LOG).display()
        );
        Ok(logs)
    }

    /// The table of the noise benchmark.
    pub fn noise_rows(&self) -> anyhow::Result<Vec<NoiseRow>> {
        let file = self.noise.clone().unwrap_or_else(|| self.results.join("noise_analysis.json"));
        ensure!(
            file.is_file(),
            "{}: no table of the noise benchmark; make it with: searoom benchmark noise --json > {}",
            file.display(),
            file.display()
        );
        let text = runs::read(&file)?;
        serde_json::from_str(&text).with_context(|| {
            format!("{}: it has to be what `searoom benchmark noise --json` printed", file.display())
        })
    }

    /// Figures of forecasts from these files.
    pub fn shown<'a>(&self, models: &'a [PathBuf]) -> figures::Shown<'a> {
        static NONE: OtherArea = OtherArea::NONE;
        figures::Shown { models, other: &NONE, segments: self.segments, seed: self.episode }
    }
}
