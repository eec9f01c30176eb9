//! Where a vessel will go: forecasts of positions from the positions seen so far.
//!
//! A history is a slice of positions on a uniform time grid, oldest first, the last one now; a
//! position that is not finite marks a time at which the vessel was not seen. A [`Forecaster`] takes
//! a batch of histories and a horizon, and gives for each history the next `horizon` positions on the
//! same grid, in the same plane and in metres. Outside everything is f64; a network casts once on
//! the way in and once on the way out.
//!
//! **Fallback.** Every forecaster reads the last [`Forecaster::history_len`] positions. Where fewer
//! are given, or one of them is not finite, it answers with the straight line through those it has
//! and says so in [`Basis`]. Fewer than two finite positions give no velocity at all: that is a
//! [`ForecastError`].
//!
//! Source: section "Trajectory prediction" and section "Supervised learning" of the maritime study in
//! Hart, Waltz, Okhrin (2024), Two-step dynamic obstacle avoidance.

use thiserror::Error;

use crate::geo::Position;

mod best_linear;
mod bounds;
pub mod dataset;
mod encoding;
mod evaluate;
mod linear;
mod lstm;
mod model;
pub mod network;
pub mod sample_table;
mod segment;
mod split;
mod training;
mod unrolled;

pub use best_linear::BestLinearForecaster;
pub use encoding::Scaling;
pub use evaluate::{
    Errors, Evaluation, EvaluationConfig, EvaluationError, NoiseErrors, RouteErrors, StepErrors, evaluate,
    quantiles_of,
};
pub use linear::LinearForecaster;
pub use lstm::LstmForecaster;
pub use model::{DataConfig, Model, ModelConfig, ModelError, ModelKind};
pub use segment::{Quantiles, Segment, quantile, rmse_m};
pub use split::{Split, SplitConfig, SplitError, split_by_time};
pub use training::{StageConfig, Trainer, TrainingConfig, Update};
pub use unrolled::Loss;

/// Predicts a batch of paths.
pub trait Forecaster: Send {
    /// What tables and figures call it.
    fn name(&self) -> &str;

    /// Positions of history it reads.
    fn history_len(&self) -> usize;

    /// Writes the `horizon` positions that follow each history into `forecasts`, path `i` for history
    /// `i`.
    ///
    /// # Errors
    ///
    /// When a history has fewer than two finite positions among the last [`Self::history_len`].
    fn forecast(
        &mut self,
        histories: &[&[Position]],
        horizon: usize,
        forecasts: &mut Forecasts,
    ) -> Result<(), ForecastError>;

    /// Forecasts and backcasts in one batch: path `i` follows history `i`, path `n + i` of `n`
    /// histories leads up to it, nearest position first.
    ///
    /// The past is the future of the reversed history; that suits motions which look the same
    /// backwards in time, as the obstacles of open water do.
    ///
    /// # Errors
    ///
    /// As [`Self::forecast`]; the past is predicted from the *first* [`Self::history_len`] positions.
    fn forecast_both_ways(
        &mut self,
        histories: &[&[Position]],
        horizon: usize,
        forecasts: &mut Forecasts,
    ) -> Result<(), ForecastError> {
        let reversed: Vec<Vec<Position>> = histories
            .iter()
            .map(|history| history.iter().take(self.history_len()).rev().copied().collect())
            .collect();
        let both: Vec<&[Position]> =
            histories.iter().copied().chain(reversed.iter().map(Vec::as_slice)).collect();
        self.forecast(&both, horizon, forecasts)
    }
}

/// Why no forecast could be made.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ForecastError {
    /// Nothing tells how the vessel moves.
    #[error(
        "history {history} of the batch has {finite} finite position(s) among the last {window}; a forecast \
         needs two"
    )]
    NoVelocity {
        /// Index of the history in its batch.
        history: usize,
        /// Finite positions found.
        finite: usize,
        /// Positions looked at.
        window: usize,
    },
}

/// What a forecast rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Basis {
    /// The forecaster's own model, on a complete history.
    #[default]
    Model,
    /// A straight line, since the history is shorter than the forecaster needs.
    TooShort,
    /// A straight line, since the history has positions that are not finite.
    Gap,
}

/// The paths of one batch; the buffers are kept from batch to batch.
#[derive(Debug, Clone, Default)]
pub struct Forecasts {
    horizon: usize,
    positions: Vec<Position>,
    bases: Vec<Basis>,
}

impl Forecasts {
    /// Empty buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes room for `batch` paths of `horizon` positions.
    pub fn reset(&mut self, batch: usize, horizon: usize) {
        self.horizon = horizon;
        self.positions.clear();
        self.positions.resize(batch * horizon, Position::ORIGIN);
        self.bases.clear();
        self.bases.resize(batch, Basis::Model);
    }

    /// Number of paths.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bases.len()
    }

    /// Whether there is no path.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bases.is_empty()
    }

    /// The predicted positions of one history, the nearest in time first.
    ///
    /// # Panics
    ///
    /// When `index` is not below [`Self::len`].
    #[must_use]
    pub fn path(&self, index: usize) -> &[Position] {
        &self.positions[index * self.horizon..(index + 1) * self.horizon]
    }

    /// What the path of one history rests on.
    ///
    /// # Panics
    ///
    /// When `index` is not below [`Self::len`].
    #[must_use]
    pub fn basis(&self, index: usize) -> Basis {
        self.bases[index]
    }

    /// How many paths are straight lines because the history did not serve the model.
    #[must_use]
    pub fn fallbacks(&self) -> usize {
        self.bases.iter().filter(|&&basis| basis != Basis::Model).count()
    }

    fn path_mut(&mut self, index: usize) -> &mut [Position] {
        &mut self.positions[index * self.horizon..(index + 1) * self.horizon]
    }
}

/// The last `length` positions of a history, or all where there are fewer.
fn window(history: &[Position], length: usize) -> &[Position] {
    &history[history.len().saturating_sub(length)..]
}

/// Whether a model that reads `length` positions can work on this history, and if not, why.
fn basis_of(history: &[Position], length: usize) -> Basis {
    if history.len() < length {
        Basis::TooShort
    } else if window(history, length).iter().all(|position| position.is_finite()) {
        Basis::Model
    } else {
        Basis::Gap
    }
}
