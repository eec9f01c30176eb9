//! The noise benchmark (paper, section "Robustness to noise" of the maritime study; figure
//! `noise_analysis`): how often agents and classical policies come into contact as their sensors get worse.
//!
//! Everyone sails the same seeded head-on encounters through [`Coastal`]: the same tracks, traffic,
//! disturbances and sensor noise. What the recorded vessel is expected to do depends on neither of them,
//! so it is forecast once per episode and noise, in batches, and shared.
//!
//! The work falls into [`Group`]s, one per part of the tracks, scenario and noise, and in each into one
//! [`Cell`] per [`Contestant`]. A cell keeps the actions of every voyage, from which its episode can be
//! sailed again.

use std::collections::BTreeSet;
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

mod contestant;
mod foresight;
mod summary;
mod voyage;

pub use contestant::{Contestant, Estimates, Helm, Kind};
pub use foresight::{Foresight, ThinnedPath, forecast};
pub use summary::{ClosestQuantiles, Row, Share, rows};
pub use voyage::{Voyage, record};

use crate::encounter::RulesConfig;
use crate::env::coastal::{Coastal, CoastalConfig, CoastalError, RecordedTraffic, ScenarioChoice};
use crate::env::{ActionError, SeedDomain};
use crate::forecast::ForecastError;
use crate::scenario::encounter_starts::HeadOnKind;

/// What is sailed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseConfig {
    /// Standard deviations of the sensor noise on north and on east, in metres.
    pub sigmas_m: Vec<f64>,
    /// Which scenarios.
    pub scenario: ScenarioChoice,
    /// Episodes of each scenario and noise.
    pub episodes: usize,
    /// Seed of the episodes.
    pub seed: u64,
    /// What counts as an encounter and as good conduct in it, for the compliance score.
    pub rules: RulesConfig,
    /// Histories that the forecaster takes in one batch.
    pub forecast_batch: usize,
    /// The episodes; scenario, noise and source of estimates are set by the benchmark.
    pub coastal: CoastalConfig,
}

impl Default for NoiseConfig {
    fn default() -> Self {
        Self {
            sigmas_m: vec![0.0, 5.0, 10.0, 20.0],
            scenario: ScenarioChoice::Both,
            episodes: 100,
            seed: 1,
            rules: RulesConfig::default(),
            forecast_batch: 32,
            coastal: CoastalConfig::default(),
        }
    }
}

impl NoiseConfig {
    /// The seeds of the episodes: the same for everyone, and none that training has seen. More episodes
    /// begin with those of fewer.
    #[must_use]
    pub fn episode_seeds(&self) -> Vec<u64> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        (0..self.episodes).map(|_| SeedDomain::Benchmark.seed(rng.random())).collect()
    }

    /// The groups of these waters, one per scenario and noise.
    #[must_use]
    pub fn groups<'w>(&self, waters: &'w Waters) -> Vec<Group<'w>> {
        let group = |&kind, &sigma_m| Group { waters, kind, sigma_m };
        let kinds = self.scenario.kinds();
        kinds.iter().flat_map(|kind| self.sigmas_m.iter().map(move |sigma_m| group(kind, sigma_m))).collect()
    }
}

/// Which tracks episodes are drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TracksPart {
    /// The time span that neither forecasters nor agents have seen.
    HeldOut,
    /// The time span they learnt from.
    Training,
    /// All of them: an area in which nothing was trained.
    Whole,
}

impl TracksPart {
    /// As tables and files write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::HeldOut => "held-out",
            Self::Training => "training",
            Self::Whole => "whole",
        }
    }
}

/// Recorded vessels to meet.
#[derive(Debug, Clone)]
pub struct Waters {
    /// Which tracks they are.
    pub part: TracksPart,
    /// The vessels and the starts on their tracks.
    pub traffic: Arc<RecordedTraffic>,
    /// Vessels that training has seen.
    pub seen: BTreeSet<u32>,
}

/// Episodes of one scenario under one noise.
#[derive(Debug, Clone, Copy)]
pub struct Group<'w> {
    /// Whom they meet.
    pub waters: &'w Waters,
    /// The scenario.
    pub kind: HeadOnKind,
    /// Standard deviation of the sensor noise, in metres.
    pub sigma_m: f64,
}

/// As files, tables and `--scenario` write a scenario.
#[must_use]
pub fn scenario_name(kind: HeadOnKind) -> &'static str {
    match kind {
        HeadOnKind::BeforeCurve => "before-curve",
        HeadOnKind::StraightOn => "straight-on",
    }
}

/// What one contestant made of one group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Name of the contestant.
    pub policy: String,
    /// Whose tracks.
    pub tracks: TracksPart,
    /// The scenario.
    pub scenario: HeadOnKind,
    /// Standard deviation of the sensor noise, in metres.
    pub sigma_m: f64,
    /// In the order of [`NoiseConfig::episode_seeds`].
    pub voyages: Vec<Voyage>,
}

/// Why a benchmark cannot go on.
#[derive(Debug, Error)]
pub enum NoiseError {
    /// There is no environment.
    #[error(transparent)]
    Coastal(#[from] CoastalError),
    /// A history that no forecast can be made of.
    #[error("the forecaster \"{forecaster}\": {source}")]
    Forecast {
        /// Its name.
        forecaster: String,
        /// What it says.
        source: ForecastError,
    },
    /// Someone steers in a way that no ship can.
    #[error("{policy}, episode {episode}: {source}")]
    Action {
        /// Name of the contestant.
        policy: String,
        /// Number of the episode, from 0.
        episode: usize,
        /// What the environment says.
        source: ActionError,
    },
    /// A contestant that sails other episodes than the rest.
    #[error(
        "{policy} was trained in other encounters (its `[coastal]` table differs in {key}); only policies of the \
         same encounters can be compared"
    )]
    OtherEpisodes {
        /// Name of the contestant.
        policy: String,
        /// The first key that differs.
        key: String,
    },
}

/// Episodes that a thread sails with one environment.
const EPISODES_PER_TASK: usize = 5;

impl Group<'_> {
    /// The environment of a contestant, or of the forecasts where there is none.
    fn env(
        &self,
        config: &NoiseConfig,
        with: Option<(&Contestant, &Foresight)>,
    ) -> Result<Coastal, CoastalError> {
        let coastal = with.map_or(&config.coastal, |(contestant, _)| &contestant.coastal);
        let coastal = CoastalConfig {
            scenario: match self.kind {
                HeadOnKind::BeforeCurve => ScenarioChoice::BeforeCurve,
                HeadOnKind::StraightOn => ScenarioChoice::StraightOn,
            },
            noise_m: self.sigma_m,
            estimates: with.map_or_else(Default::default, |(contestant, _)| contestant.estimates.source()),
            ..coastal.clone()
        };
        let paths = with.and_then(|(contestant, foresight)| foresight.paths(contestant));
        Coastal::with_paths(coastal, Arc::clone(&self.waters.traffic), paths)
    }

    /// Lets a contestant sail every episode, in parallel on the threads of the current rayon pool. The
    /// result does not depend on their number. `finished` is told of every episode.
    ///
    /// # Errors
    ///
    /// When there is no environment, or an action that it refuses.
    pub fn sail(
        &self,
        config: &NoiseConfig,
        contestant: &Contestant,
        foresight: &Foresight,
        finished: &(dyn Fn() + Sync),
    ) -> Result<Cell, NoiseError> {
        let seeds: Vec<(usize, u64)> = config.episode_seeds().into_iter().enumerate().collect();
        let voyages: Vec<Vec<Voyage>> = seeds
            .par_chunks(EPISODES_PER_TASK)
            .map(|task| {
                let mut env = self.env(config, Some((contestant, foresight)))?;
                env.keep_steps();
                let mut helm = contestant.helm();
                let sail = |&(episode, seed): &(usize, u64)| {
                    let voyage = Voyage::sail(&mut env, helm.as_mut(), seed, &config.rules);
                    finished();
                    voyage.map_err(|source| NoiseError::Action {
                        policy: contestant.name.clone(),
                        episode,
                        source,
                    })
                };
                task.iter().map(sail).collect()
            })
            .collect::<Result<_, NoiseError>>()?;
        Ok(Cell {
            policy: contestant.name.clone(),
            tracks: self.waters.part,
            scenario: self.kind,
            sigma_m: self.sigma_m,
            voyages: voyages.concat(),
        })
    }
}

#[cfg(test)]
mod tests;
