//! The paper's forecasters: an LSTM that is called again and again on what it has predicted.

use super::encoding::Paths;
use super::linear::straight_on;
use super::network::{Batch, NetworkState};
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
    rows: usize,
    state: NetworkState<f32>,
    histories: Vec<f32>,
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
        let buffers = self.buffers.take().filter(|buffers| buffers.rows == rows);
        let buffers = self.buffers.insert(buffers.unwrap_or_else(|| Buffers {
            rows,
            state: network.state(rows),
            histories: vec![0.0; steps * rows * 2],
            anchors: vec![0.0; rows * 2],
        }));
        self.paths.start(&encoding, histories.iter().copied(), calls);
        for _ in 0..calls {
            self.paths.encode(encoding.scaling, steps, &mut buffers.histories, &mut buffers.anchors);
            let batch = Batch { histories: &buffers.histories, anchors: &buffers.anchors, rows };
            let output = network.forward(&mut self.compute, batch, &mut buffers.state);
            self.paths.extend(&encoding, output);
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
