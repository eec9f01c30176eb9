//! The experiments of the paper, one file each, and the statistics they rest on.
//!
//! An experiment takes what was trained, recorded or measured and makes a [`Product`]: a drawing, the
//! numbers in it, and a caption that says what was run. None reads or writes files; `searoom experiment`
//! does, and so does `searoom forecast plot` for the figures of forecasts. [`tuning`] searches settings of
//! the classical policies.

mod agents_in_episode;
pub mod architecture;
pub mod coastal_results;
pub mod curves;
pub mod env_example;
pub mod env_situations;
pub mod estimator_training;
mod field_record;
pub mod forecasts;
pub mod h_ablate;
mod learning;
pub mod noise;
pub mod noise_analysis;
pub mod prediction;
pub mod prediction_rmse;
mod product;
pub mod quantile_forecast_vessel;
pub mod recorded_trajectories;
pub mod replacement;
mod sailors;
pub mod single_estimates;
pub mod smoothing_distance;
pub mod statistics;
pub mod train_results;
pub mod tuning;

pub use agents_in_episode::make as agents_in_episode;
pub use field_record::{FieldRecord, ObstacleTrace, Violation};
pub use learning::{COASTAL, OPEN_WATER, PaperTraining};
pub use product::{Cell, DataTable, Drawing, Product};
pub use sailors::{Pilot, Sailor};

use self::curves::Waters;

/// The figures, by the paper's names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Experiment {
    /// The two steps with their sizes.
    Architecture,
    /// Loss of the forecasters.
    EstimatorTraining,
    /// One forecast of a wandering vessel.
    Ar1Prediction,
    /// One forecast of a weaving vessel.
    SinusPrediction,
    /// Forecast errors in open water.
    PredictionRmse,
    /// Raw and smoothed distance with its minima.
    SmoothingDistance,
    /// A stretch of open water.
    EnvExample,
    /// A replacement.
    Replacement,
    /// Learning curves in open water.
    TrainResults,
    /// Final return over the length of the history.
    HAblate,
    /// Agent and baseline among wandering obstacles.
    EnvExampleAr1,
    /// Agent and baseline among weaving obstacles.
    EnvExampleSinus,
    /// The recorded trajectories.
    EbeltoftTrajs,
    /// Four coastal forecasts.
    TrajAisSingleEstimates,
    /// Forecast errors in coastal waters.
    QuantileForecastVessel,
    /// The two coastal scenarios.
    AisEnvSituations,
    /// Learning curves in coastal waters.
    AisResults,
    /// Collision rate under noise.
    NoiseAnalysis,
}

/// What has to be there before a figure can be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// The open-water forecasters for these motions.
    Forecasters(&'static [Waters]),
    /// The coastal forecaster and the recorded tracks it was trained on.
    CoastalForecaster,
    /// Logs of the training of the open-water forecasters.
    ForecasterLogs,
    /// Learning curves of the four agents in these waters.
    Curves(&'static [Waters]),
    /// Learning curves over lengths of the history.
    Ablation,
    /// An agent and its baseline, trained in these waters.
    Agents(Waters),
    /// The table of the noise benchmark.
    NoiseBenchmark,
}

const OPEN: &[Waters] = &[Waters::Stochastic, Waters::Periodic];

impl Experiment {
    /// All of them, in the order of the paper.
    pub const ALL: [Self; 18] = [
        Self::Architecture,
        Self::EstimatorTraining,
        Self::Ar1Prediction,
        Self::SinusPrediction,
        Self::PredictionRmse,
        Self::SmoothingDistance,
        Self::EnvExample,
        Self::Replacement,
        Self::TrainResults,
        Self::HAblate,
        Self::EnvExampleAr1,
        Self::EnvExampleSinus,
        Self::EbeltoftTrajs,
        Self::TrajAisSingleEstimates,
        Self::QuantileForecastVessel,
        Self::AisEnvSituations,
        Self::AisResults,
        Self::NoiseAnalysis,
    ];

    /// Name, what it shows and what it needs.
    #[must_use]
    pub fn description(self) -> (&'static str, &'static str, Needs) {
        match self {
            Self::Architecture => {
                ("architecture", "the two-step architecture with the sizes in use", Needs::Nothing)
            }
            Self::EstimatorTraining => {
                ("estimator_training", "forecaster loss over training, both motions", Needs::ForecasterLogs)
            }
            Self::Ar1Prediction => (
                "AR1_prediction",
                "a forecast and backcast of a wandering vessel against the truth",
                Needs::Forecasters(&[Waters::Stochastic]),
            ),
            Self::SinusPrediction => (
                "sinus_prediction",
                "a forecast and backcast of a weaving vessel against the truth",
                Needs::Forecasters(&[Waters::Periodic]),
            ),
            Self::PredictionRmse => (
                "prediction_rmse",
                "error quantiles over the horizon, both motions",
                Needs::Forecasters(OPEN),
            ),
            Self::SmoothingDistance => (
                "smoothing_distance",
                "raw and smoothed distance with the sampled and the refined CPA",
                Needs::Forecasters(&[Waters::Periodic]),
            ),
            Self::EnvExample => ("env_example", "a stretch of an open-water episode", Needs::Nothing),
            Self::Replacement => {
                ("replacement", "a replacement of an obstacle in open water", Needs::Nothing)
            }
            Self::TrainResults => {
                ("trainResults", "test return over steps in open water", Needs::Curves(OPEN))
            }
            Self::HAblate => ("h_ablate", "final return over the length of the history", Needs::Ablation),
            Self::EnvExampleAr1 => (
                "env_example_AR1",
                "agent against baseline among wandering obstacles",
                Needs::Agents(Waters::Stochastic),
            ),
            Self::EnvExampleSinus => (
                "env_example_sinus",
                "agent against baseline among weaving obstacles",
                Needs::Agents(Waters::Periodic),
            ),
            Self::EbeltoftTrajs => {
                ("Ebeltoft_trajs", "the recorded trajectories on a map of the area", Needs::CoastalForecaster)
            }
            Self::TrajAisSingleEstimates => (
                "traj_AIS_single_estimates",
                "four forecasts against recorded tracks",
                Needs::CoastalForecaster,
            ),
            Self::QuantileForecastVessel => (
                "quantile_forecast_vessel",
                "error quantiles over 200 steps in coastal waters",
                Needs::CoastalForecaster,
            ),
            Self::AisEnvSituations => {
                ("AIS_env_situations", "the two coastal scenarios", Needs::CoastalForecaster)
            }
            Self::AisResults => {
                ("AIS_results", "test return over steps in coastal waters", Needs::Curves(&[Waters::Coastal]))
            }
            Self::NoiseAnalysis => (
                "noise_analysis",
                "collision rate under sensor noise, each policy and scenario",
                Needs::NoiseBenchmark,
            ),
        }
    }

    /// The paper's name of the figure.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.description().0
    }

    /// The figure of this name, whatever the case of its letters.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|experiment| experiment.name().eq_ignore_ascii_case(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_and_found() {
        for (index, experiment) in Experiment::ALL.into_iter().enumerate() {
            assert_eq!(Experiment::named(experiment.name()), Some(experiment));
            assert_eq!(Experiment::ALL.iter().position(|other| *other == experiment), Some(index));
        }
        assert_eq!(Experiment::named("ais_RESULTS"), Some(Experiment::AisResults));
        assert_eq!(Experiment::named("figure"), None);
    }
}
