//! Where the recorded vessel is expected to go: the paths behind the estimates of its collision risk.
//!
//! A path depends on the track, the moment and the sensor noise, never on what own ship does. It can
//! therefore be computed at the moment ([`LivePaths`]) or beforehand for many episodes at once, to be
//! shared by every own ship that sails them ([`KnownPaths`]).

use std::collections::HashMap;
use std::sync::Arc;

use crate::forecast::sample_table::{SampleTable, as_kept};
use crate::forecast::{Basis, ForecastError, Forecaster, Forecasts};
use crate::geo::Position;

/// A decision at which the recorded vessel is forecast.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Moment {
    /// Seed of the episode.
    pub seed: u64,
    /// Number of the decision.
    pub decision: usize,
    /// The track and the sample on it at which the vessel is.
    pub sample: (usize, usize),
}

/// A forecast of the recorded vessel.
#[derive(Debug, Clone, PartialEq)]
pub struct Path {
    /// Positions one time step apart, the next one first.
    pub positions: Arc<[Position]>,
    /// What they rest on.
    pub basis: Basis,
}

/// What an environment takes its forecasts from.
pub trait PathSource: Send {
    /// The `steps` positions that follow `history` (as sensed, oldest first); nothing where nothing tells
    /// how the vessel moves.
    fn path(&mut self, moment: Moment, history: &[Position], steps: usize) -> Option<Path>;
}

/// Forecasts at the moment they are asked for.
pub struct LivePaths {
    forecaster: Box<dyn Forecaster>,
    forecasts: Forecasts,
    /// Forecasts without noise depend on the track alone and are kept.
    known: Option<HashMap<(usize, usize), Path>>,
}

impl LivePaths {
    /// By `forecaster`. Where histories are free of noise, the path of a sample is computed once.
    #[must_use]
    pub fn new(forecaster: Box<dyn Forecaster>, noise_free: bool) -> Self {
        Self { forecaster, forecasts: Forecasts::new(), known: noise_free.then(HashMap::new) }
    }
}

impl PathSource for LivePaths {
    fn path(&mut self, moment: Moment, history: &[Position], steps: usize) -> Option<Path> {
        if let Some(path) = self.known.as_ref().and_then(|known| known.get(&moment.sample)) {
            return Some(path.clone());
        }
        self.forecaster.forecast(&[history], steps, &mut self.forecasts).ok()?;
        let (forecast, basis) = (self.forecasts.path(0), self.forecasts.basis(0));
        let Some(known) = &mut self.known else {
            return Some(Path { positions: forecast.into(), basis });
        };
        // The very bits of a table, so that a run may take either.
        let here = *history.last()?;
        let path = Path { positions: forecast.iter().map(|&there| as_kept(here, there)).collect(), basis };
        known.insert(moment.sample, path.clone());
        Some(path)
    }
}

/// Forecasts of the samples of noise-free tracks, made beforehand. Its clones share them.
#[derive(Debug, Clone)]
pub struct TablePaths(Arc<SampleTable>);

impl TablePaths {
    /// From a table, which should hold every sample that episodes can ask for:
    /// [`RecordedTraffic::forecast_samples`](super::RecordedTraffic::forecast_samples).
    #[must_use]
    pub fn new(table: Arc<SampleTable>) -> Self {
        Self(table)
    }
}

impl PathSource for TablePaths {
    fn path(&mut self, moment: Moment, history: &[Position], _steps: usize) -> Option<Path> {
        let (positions, basis) = self.0.path(moment.sample, *history.last()?)?;
        Some(Path { positions: positions.into(), basis })
    }
}

/// Forecasts that were computed beforehand. Its clones share them.
#[derive(Debug, Clone, Default)]
pub struct KnownPaths(Arc<HashMap<(u64, usize), Path>>);

impl KnownPaths {
    /// Forecasts what follows the histories over `steps` steps, all in one batch.
    ///
    /// # Errors
    ///
    /// When a history has fewer than two finite positions.
    pub fn forecast(
        forecaster: &mut dyn Forecaster,
        moments: &[(Moment, Vec<Position>)],
        steps: usize,
    ) -> Result<Vec<(Moment, Path)>, ForecastError> {
        let mut forecasts = Forecasts::new();
        let histories: Vec<&[Position]> = moments.iter().map(|(_, history)| history.as_slice()).collect();
        forecaster.forecast(&histories, steps, &mut forecasts)?;
        let path = |index| Path { positions: forecasts.path(index).into(), basis: forecasts.basis(index) };
        Ok(moments.iter().enumerate().map(|(index, (moment, _))| (*moment, path(index))).collect())
    }
}

impl FromIterator<(Moment, Path)> for KnownPaths {
    fn from_iter<T: IntoIterator<Item = (Moment, Path)>>(paths: T) -> Self {
        let paths = paths.into_iter().map(|(moment, path)| ((moment.seed, moment.decision), path));
        Self(Arc::new(paths.collect()))
    }
}

impl PathSource for KnownPaths {
    fn path(&mut self, moment: Moment, _history: &[Position], _steps: usize) -> Option<Path> {
        self.0.get(&(moment.seed, moment.decision)).cloned()
    }
}
