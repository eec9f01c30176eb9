//! The figures of forecasts from models on disk: what `searoom forecast plot` and `searoom experiment`
//! share.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::data::{self, OtherArea};
use super::evaluate::measure;
use crate::experiment::curves::Origin;
use crate::experiment::estimator_training::{self, TrainingLog};
use crate::experiment::forecasts::Measured;
use crate::experiment::{Product, prediction, prediction_rmse, quantile_forecast_vessel, single_estimates};
use crate::forecast::{EvaluationConfig, LstmForecaster, Model, ModelKind, Segment};

/// What a figure of forecasts is made of.
pub(in crate::cli) struct Shown<'a> {
    pub models: &'a [PathBuf],
    pub other: &'a OtherArea,
    pub segments: usize,
    pub seed: u64,
}

impl Shown<'_> {
    fn forecasters(&self) -> anyhow::Result<Vec<LstmForecaster>> {
        if self.models.is_empty() {
            bail!("this figure needs a trained model: give --model FILE");
        }
        self.models.iter().map(|path| forecaster(path)).collect()
    }

    /// One synthetic path for each model, whose middle is observed.
    pub fn prediction(&self) -> anyhow::Result<Product> {
        let mut shown = Vec::new();
        for forecaster in self.forecasters()? {
            let config = &forecaster.model().config;
            if config.kind != ModelKind::OpenWater {
                bail!("{} forecasts coastal traffic; this figure shows open water", config.name);
            }
            let path = data::synthetic_path(config, prediction::path_len(&forecaster), self.seed)?;
            shown.push((forecaster, path));
        }
        Ok(prediction::make(&mut shown, self.seed)?)
    }

    /// Errors over the horizon, a panel for each model.
    pub fn errors(&self) -> anyhow::Result<Product> {
        let measured: Vec<Measured> = self
            .forecasters()?
            .iter_mut()
            .map(|forecaster| self.measured(forecaster))
            .collect::<anyhow::Result<_>>()?;
        Ok(match &measured[..] {
            [coastal] if coastal.is_recorded() => quantile_forecast_vessel::make(coastal),
            several => prediction_rmse::make(several),
        })
    }

    fn measured(&self, forecaster: &mut LstmForecaster) -> anyhow::Result<Measured> {
        let config = forecaster.model().config.clone();
        let held_out = data::held_out(&config, self.other, config.kind.horizon(), self.segments, self.seed)?;
        let noiseless = EvaluationConfig { noise_m: Vec::new(), ..EvaluationConfig::default() };
        let evaluation = measure(forecaster, &held_out, &noiseless)?;
        Ok(Measured::new(forecaster.model(), evaluation, self.other.area()))
    }

    /// Forecasts of four held-out segments with a curve.
    pub fn estimates(&self) -> anyhow::Result<Product> {
        let mut forecasters = self.forecasters()?;
        let [forecaster] = &mut forecasters[..] else {
            bail!("this figure shows one model: give --model once")
        };
        let config = forecaster.model().config.clone();
        let horizon = config.kind.horizon();
        let held_out = data::held_out(&config, self.other, horizon, self.segments, self.seed)?;
        let curve_rad = EvaluationConfig::default().curve_deg.to_radians();
        let curves: Vec<&Segment> =
            held_out.segments.iter().filter(|segment| segment.has_curve(curve_rad)).collect();
        single_estimates::make(forecaster, &curves)?.with_context(|| {
            format!(
                "only {} of the held-out segments have a curve; {} are shown: raise --segments or take another area",
                curves.len(),
                single_estimates::ESTIMATES
            )
        })
    }
}

/// A trained forecaster, to compute on one thread.
pub(in crate::cli) fn forecaster(path: &Path) -> anyhow::Result<LstmForecaster> {
    Ok(LstmForecaster::new(Model::open(path)?, 1))
}

/// Logs of trainings given as files, without more than they say.
pub(super) fn training(logs: &[PathBuf]) -> anyhow::Result<Product> {
    if logs.is_empty() {
        bail!("estimator_training is drawn from the logs of training runs: give --log FILE");
    }
    let read = |path: &PathBuf| -> anyhow::Result<TrainingLog> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let run = path.parent().and_then(Path::file_name);
        let name = run.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(TrainingLog::parse(name, path, &text, None, None::<Origin>)?)
    };
    let logs: Vec<TrainingLog> = logs.iter().map(read).collect::<anyhow::Result<_>>()?;
    Ok(estimator_training::make(&logs))
}
