//! The paper's forecasters: an LSTM that is called again and again on what it has predicted.

use super::encoding::Paths;
use super::linear::straight_on;
use super::network::Rollout;
use super::{Basis, ForecastError, Forecaster, Forecasts, Model, basis_of};
use crate::geo::Position;
use crate::nn::Compute;

/// Forecasts with a trained [`Model`].
pub struct LstmForecaster {
    model: Model,
    compute: Compute,
    paths: Paths,
    buffers: Option<Buffers>,
}

struct Buffers {
    /// Most paths there is room for.
    capacity: usize,
    rollout: Rollout<f32>,
    displacements: Vec<f32>,
    anchors: Vec<f32>,
}

impl LstmForecaster {
    /// On `threads` threads.
    #[must_use]
    pub fn new(model: Model, threads: usize) -> Self {
        Self { compute: Compute::new(threads), paths: Paths::default(), buffers: None, model }
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Extends the paths of the histories that serve the model to the horizon.
    fn roll_out(&mut self, histories: &[&[Position]], horizon: usize) {
        let encoding = self.model.config.encoding();
        let (rows, steps) = (histories.len(), encoding.history_len - 1);
        let calls = horizon.div_ceil(encoding.outputs);
        let network = &self.model.network;
        let buffers = self.buffers.take().filter(|buffers| buffers.capacity >= rows);
        let Buffers { rollout, displacements, anchors, .. } =
            self.buffers.insert(buffers.unwrap_or_else(|| Buffers {
                capacity: rows,
                rollout: network.rollout(rows),
                displacements: vec![0.0; rows * 2],
                anchors: vec![0.0; rows * 2],
            }));
        let (displacements, anchors) = (&mut displacements[..rows * 2], &mut anchors[..rows * 2]);
        self.paths.start(&encoding, histories.iter().copied(), calls);
        network.begin(&self.compute, calls, rows, rollout);
        for step in 0..steps + calls.saturating_sub(1) * encoding.outputs {
            self.paths.encode_displacement(encoding.scaling, step, displacements);
            self.paths.encode_anchor(encoding.scaling, anchors);
            if let Some(output) = network.take(&mut self.compute, displacements, anchors, rollout) {
                self.paths.extend(&encoding, output);
            }
        }
    }
}

impl Forecaster for LstmForecaster {
    fn name(&self) -> &str {
        &self.model.config.name
    }

    fn history_len(&self) -> usize {
        self.model.config.kind.history_len()
    }

    fn forecast(
        &mut self,
        histories: &[&[Position]],
        horizon: usize,
        forecasts: &mut Forecasts,
    ) -> Result<(), ForecastError> {
        forecasts.reset(histories.len(), horizon);
        let length = self.history_len();
        let mut served = Vec::with_capacity(histories.len());
        for (index, history) in histories.iter().enumerate() {
            match basis_of(history, length) {
                Basis::Model => served.push(index),
                basis => straight_on(index, history, length, basis, forecasts)?,
            }
        }
        if served.is_empty() {
            return Ok(());
        }
        let complete: Vec<&[Position]> = served.iter().map(|&index| histories[index]).collect();
        self.roll_out(&complete, horizon);
        let encoding = self.model.config.encoding();
        for (row, &index) in served.iter().enumerate() {
            let path = self.paths.future(&encoding, row);
            forecasts.path_mut(index).copy_from_slice(&path[..horizon]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::dataset::{Process, SyntheticConfig, SyntheticSegments};
    use super::super::{DataConfig, ModelConfig, ModelKind, Trainer, TrainingConfig};
    use super::*;
    use crate::vessel::StochasticConfig;

    const MISSING: Position = Position { north_m: f64::NAN, east_m: f64::NAN };

    fn forecaster(kind: ModelKind) -> LstmForecaster {
        let process = Process::Stochastic(StochasticConfig::default());
        let segments = SyntheticConfig::default();
        let source = SyntheticSegments { process, config: segments, history_len: 1, horizon: 0 };
        let config = ModelConfig {
            name: "untrained".into(),
            kind,
            data: DataConfig::Synthetic { process, segments },
            training: TrainingConfig::default(),
        };
        let trainer = Trainer::new(kind, config.training.clone(), Box::new(source), 1).unwrap();
        LstmForecaster::new(Model::of(&trainer, &config, None), 1)
    }

    fn way(length: usize, turn: f64) -> Vec<Position> {
        (0..length).map(|k| Position { north_m: 40.0 * k as f64, east_m: turn * (k * k) as f64 }).collect()
    }

    #[test]
    fn histories_that_do_not_serve_the_model_are_answered_by_a_line_beside_the_others() {
        for kind in [ModelKind::OpenWater, ModelKind::Coastal] {
            let mut forecaster = forecaster(kind);
            let length = forecaster.history_len();
            let (complete, short) = (way(length + 3, 0.1), way(length - 1, 0.0));
            let mut gap = way(length, 0.0);
            gap[length / 2] = MISSING;
            let mut forecasts = Forecasts::new();
            forecaster.forecast(&[&gap, &complete, &short], 30, &mut forecasts).unwrap();
            let bases: Vec<Basis> = (0..3).map(|path| forecasts.basis(path)).collect();
            assert_eq!(bases, [Basis::Gap, Basis::Model, Basis::TooShort]);
            let straight = Position { north_m: 40.0 * (length as f64 + 29.0), east_m: 0.0 };
            assert!(forecasts.path(0)[29].distance_m(straight) < 1e-6);

            let mut alone = Forecasts::new();
            forecaster.forecast(&[&complete], 30, &mut alone).unwrap();
            assert_eq!(alone.path(0), forecasts.path(1));
        }
    }

    /// A run may take its forecasts one by one or from large batches, on any number of threads.
    #[test]
    fn a_forecast_has_the_same_bits_alone_and_in_a_batch() {
        for kind in [ModelKind::OpenWater, ModelKind::Coastal] {
            let mut forecaster = forecaster(kind);
            let length = forecaster.history_len();
            let ways: Vec<Vec<Position>> = (0..67).map(|k| way(length, 0.01 * f64::from(k))).collect();
            let histories: Vec<&[Position]> = ways.iter().map(Vec::as_slice).collect();
            let mut many = LstmForecaster::new(forecaster.model().clone(), 2);
            let (mut together, mut alone) = (Forecasts::new(), Forecasts::new());
            many.forecast(&histories, 30, &mut together).unwrap();
            for index in [0, 1, 31, 32, 66] {
                forecaster.forecast(&histories[index..=index], 30, &mut alone).unwrap();
                assert_eq!(alone.path(0), together.path(index), "{index}");
            }
        }
    }

    #[test]
    fn a_history_without_velocity_is_an_error() {
        let error = forecaster(ModelKind::OpenWater)
            .forecast(&[&way(10, 0.0), &[MISSING; 10]], 5, &mut Forecasts::new())
            .unwrap_err();
        assert_eq!(error, ForecastError::NoVelocity { history: 1, finite: 0, window: 10 });
    }

    #[test]
    fn a_shorter_horizon_gives_the_beginning_of_a_longer_one() {
        let mut forecaster = forecaster(ModelKind::Coastal);
        let history = way(75, 0.05);
        let (mut long, mut short) = (Forecasts::new(), Forecasts::new());
        forecaster.forecast(&[&history], 30, &mut long).unwrap();
        forecaster.forecast(&[&history], 13, &mut short).unwrap();
        assert_eq!(short.path(0), &long.path(0)[..13]);
        forecaster.forecast(&[&history], 0, &mut short).unwrap();
        assert!(short.path(0).is_empty());
    }

    /// Coastal forecasts depend on where the vessel is, those of open water do not.
    #[test]
    fn only_the_coastal_forecaster_is_anchored() {
        for (kind, anchored) in [(ModelKind::OpenWater, false), (ModelKind::Coastal, true)] {
            let mut forecaster = forecaster(kind);
            let here = way(75, 0.05);
            let shift = crate::geo::Displacement { north_m: 4096.0, east_m: -8192.0 };
            let there: Vec<Position> = here.iter().map(|&position| position + shift).collect();
            let mut forecasts = Forecasts::new();
            forecaster.forecast(&[&here, &there], 20, &mut forecasts).unwrap();
            let apart = (forecasts.path(0)[19] + shift).distance_m(forecasts.path(1)[19]);
            assert_eq!(apart > 0.01, anchored, "{apart}");
        }
    }
}
