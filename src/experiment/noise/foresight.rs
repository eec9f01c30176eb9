//! Forecasts of a whole group beforehand, in batches, shared by everyone who takes part.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Contestant, Estimates, Group, NoiseConfig, NoiseError};
use crate::env::coastal::{KnownPaths, Moment, Path, PathSource};
use crate::forecast::Forecaster;
use crate::geo::Position;

/// What is known of the future of a group's episodes, by the number of the forecaster.
#[derive(Debug, Clone, Default)]
pub struct Foresight {
    paths: BTreeMap<usize, KnownPaths>,
}

impl Foresight {
    /// Adds the forecasts of one forecaster.
    pub fn add(&mut self, forecaster: usize, paths: KnownPaths) {
        self.paths.insert(forecaster, paths);
    }

    /// What a contestant's environment takes its estimates from; nothing for one without estimates. The
    /// true future needs no forecast.
    pub(super) fn paths(&self, contestant: &Contestant) -> Option<Box<dyn PathSource>> {
        let paths = match contestant.estimates {
            Estimates::None => return None,
            Estimates::Truth => KnownPaths::default(),
            Estimates::Forecast(forecaster) => self.paths.get(&forecaster).cloned().unwrap_or_default(),
        };
        Some(Box::new(paths))
    }
}

/// Forecasts the recorded vessel at every moment of every episode of a group, in parallel on the threads of
/// the current rayon pool. Batches are cut without regard to the number of threads, so that neither
/// are the results. `make` makes a forecaster for a batch; `finished` is told how many histories are done.
///
/// # Errors
///
/// When there is no environment, or a history tells nothing.
pub fn forecast(
    group: &Group<'_>,
    config: &NoiseConfig,
    make: &(dyn Fn() -> Box<dyn Forecaster> + Sync),
    finished: &(dyn Fn(usize) + Sync),
) -> Result<Vec<(Moment, Path)>, NoiseError> {
    let env = group.env(config, None)?;
    let moments: Vec<(Moment, Vec<Position>)> =
        config.episode_seeds().into_iter().flat_map(|seed| env.forecast_moments(seed)).collect();
    let paths: Vec<Vec<(Moment, Path)>> = moments
        .par_chunks(config.forecast_batch.max(1))
        .map_init(make, |forecaster, batch| {
            let paths = KnownPaths::forecast(forecaster.as_mut(), batch, config.coastal.forecast_steps);
            finished(batch.len());
            paths.map_err(|source| NoiseError::Forecast { forecaster: forecaster.name().to_owned(), source })
        })
        .collect::<Result<_, NoiseError>>()?;
    Ok(paths.concat())
}

/// A forecast thinned out, for replays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ThinnedPath {
    /// Seed of the episode.
    pub seed: u64,
    /// The decision at which it was made.
    pub decision: usize,
    /// Every tenth position, north and east in whole metres, the tenth from now first.
    pub points: Vec<[i32; 2]>,
}

impl ThinnedPath {
    const EVERY: usize = 10;

    /// Of a forecast.
    #[must_use]
    pub fn of((moment, path): &(Moment, Path)) -> Self {
        let kept = path.positions.iter().skip(Self::EVERY - 1).step_by(Self::EVERY);
        let points =
            kept.map(|position| [position.north_m, position.east_m].map(|metres| metres.round() as i32));
        Self { seed: moment.seed, decision: moment.decision, points: points.collect() }
    }
}
