//! The recurrent networks of the forecasters: an LSTM over displacements, dense layers on its last state.
//!
//! Source: sections "Trajectory prediction" and "Supervised learning" (maritime) of Hart, Waltz, Okhrin (2024).
//! Numbers in and out are plain and dimensionless here: whoever owns the network scales them.

use std::sync::Arc;

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::nn::weights::{WeightsError, WeightsFile, WeightsWriter};
use crate::nn::{
    Activation, Buffer, Compute, Dense, Gradients, Layout, Lstm, LstmState, LstmWindows, Parameters, Real,
    mean_squared_error,
};

/// Numbers per step of a history and per anchor: north and east.
pub const COORDINATES: usize = 2;

/// Sizes of a forecaster's network.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Displacements in a history.
    pub steps: usize,
    /// Units of the LSTM.
    pub hidden: usize,
    /// Whether the present position is joined to the LSTM's state ("anchoring").
    pub anchored: bool,
    /// Units of the dense layers between LSTM and output.
    pub layers: Vec<usize>,
    /// What follows each of them.
    pub activation: Activation,
    /// Displacements predicted at once.
    pub predicted: usize,
}

impl NetworkConfig {
    /// Open water: 9 displacements, LSTM(2 -> 64), Linear(64 -> 64) and ReLU, Linear(64 -> 2).
    pub fn open_water() -> Self {
        let activation = Activation::Relu;
        Self { steps: 9, hidden: 64, anchored: false, layers: vec![64], activation, predicted: 1 }
    }

    /// Coastal waters: 74 displacements, LSTM(2 -> 256) joined by the position, Linear(258 -> 256) and
    /// Linear(256 -> 256) with leaky ReLU, Linear(256 -> 20).
    pub fn coastal() -> Self {
        let activation = Activation::LeakyRelu { slope: 0.01 };
        Self { steps: 74, hidden: 256, anchored: true, layers: vec![256, 256], activation, predicted: 10 }
    }

    /// Length of an output vector.
    pub fn outputs(&self) -> usize {
        self.predicted * COORDINATES
    }
}

/// A forecaster's network and its weights.
///
/// Tensors are called `lstm.*` and `linear.0.*`, `linear.1.*`, ... as in a PyTorch module with an `LSTM` called
/// `lstm` and a `ModuleList` called `linear`.
#[derive(Debug, Clone)]
pub struct ForecastNetwork<T> {
    config: NetworkConfig,
    lstm: Lstm,
    linear: Vec<Dense>,
    /// The weights.
    pub parameters: Parameters<T>,
}

/// Buffers of one network for batches of up to a fixed number of rows, reused from batch to batch.
#[derive(Debug, Clone)]
pub struct NetworkState<T> {
    lstm: LstmState<T>,
    head: Head<T>,
    d_joined: Buffer<T>,
    d_outputs: Vec<Buffer<T>>,
}

/// Activations of what follows the LSTM.
#[derive(Debug, Clone)]
struct Head<T> {
    /// Last state and anchor, `[rows][hidden + 2]` or `[rows][hidden]`.
    joined: Buffer<T>,
    outputs: Vec<Buffer<T>>,
}

/// Buffers of a network that is called again and again on what it has predicted.
#[derive(Debug, Clone)]
pub struct Rollout<T> {
    lstm: LstmWindows<T>,
    head: Head<T>,
}

/// A batch: what a network reads.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a, T> {
    /// Displacements, oldest first, `[steps][rows][2]`; at most as many steps as the network is made for.
    pub histories: &'a [T],
    /// Present positions, `[rows][2]`; not looked at unless the network is anchored.
    pub anchors: &'a [T],
    /// Number of histories.
    pub rows: usize,
}

/// Where the gradients with respect to what a network has read go, in the layouts of [`Batch`].
#[derive(Debug)]
pub struct InputGradients<'a, T> {
    /// With respect to the displacements.
    pub histories: &'a mut [T],
    /// With respect to the present positions; left alone unless the network is anchored.
    pub anchors: &'a mut [T],
}

impl<T: Real> ForecastNetwork<T> {
    /// A network with PyTorch's default initialisation.
    pub fn new(config: NetworkConfig, rng: &mut impl Rng) -> Self {
        let (lstm, linear, layout) = Self::layers(&config);
        Self { config, lstm, linear, parameters: Parameters::initialised(&layout, rng) }
    }

    /// The network that [`writer`](Self::writer) wrote to `file`, with the sizes found there.
    ///
    /// # Errors
    ///
    /// When sizes or tensors are missing or do not fit together. The caller reads its own facts and then calls
    /// [`WeightsFile::finish`].
    pub fn read(file: &WeightsFile) -> Result<Self, WeightsError> {
        let text: String = file.fact("network")?;
        let invalid = |reason: String| WeightsError::Metadata {
            path: file.path().to_owned(),
            key: "network".into(),
            reason,
        };
        let config: NetworkConfig =
            serde_json::from_str(&text).map_err(|e| invalid(format!("does not describe a network: {e}")))?;
        let sizes = config.layers.iter().chain([&config.steps, &config.hidden, &config.predicted]);
        if let Some(size) = sizes.copied().find(|&size| size == 0 || size > LARGEST_SIZE) {
            return Err(invalid(format!("has a size of {size}; sizes are 1 to {LARGEST_SIZE}")));
        }
        let (lstm, linear, layout) = Self::layers(&config);
        let mut parameters = Parameters::zeros(&layout, true);
        file.read_parameters("", &mut parameters)?;
        Ok(Self { config, lstm, linear, parameters })
    }

    /// Sizes and weights, ready to be saved; the caller adds its own facts.
    pub fn writer(&self) -> WeightsWriter {
        let config = serde_json::to_string(&self.config).expect("sizes can be written");
        WeightsWriter::new().fact("network", config).tensors(
            "",
            self.parameters.layout(),
            self.parameters.values(),
        )
    }

    fn layers(config: &NetworkConfig) -> (Lstm, Vec<Dense>, Arc<Layout>) {
        let mut layout = Layout::new();
        let lstm = Lstm::new(&mut layout, "lstm", COORDINATES, config.hidden);
        let mut inputs = config.hidden + if config.anchored { COORDINATES } else { 0 };
        let mut linear = Vec::new();
        for &units in &config.layers {
            let name = format!("linear.{}", linear.len());
            linear.push(Dense::new(&mut layout, &name, inputs, units, config.activation));
            inputs = units;
        }
        let name = format!("linear.{}", linear.len());
        linear.push(Dense::new(&mut layout, &name, inputs, config.outputs(), Activation::Identity));
        (lstm, linear, Arc::new(layout))
    }

    /// The sizes.
    pub fn config(&self) -> &NetworkConfig {
        &self.config
    }

    /// Multiply-adds of one forward pass.
    pub fn operations(&self, rows: usize) -> usize {
        let linear: usize = self.linear.iter().map(|layer| layer.operations(rows)).sum();
        self.lstm.operations(self.config.steps, rows) + linear
    }

    /// Buffers for batches of up to `rows` rows.
    pub fn state(&self, rows: usize) -> NetworkState<T> {
        let joined = rows * self.linear[0].inputs();
        NetworkState {
            lstm: self.lstm.state(self.config.steps, rows),
            head: self.head(rows),
            d_joined: Buffer::zeros(joined),
            d_outputs: self.outputs(rows),
        }
    }

    fn outputs(&self, rows: usize) -> Vec<Buffer<T>> {
        self.linear.iter().map(|layer| Buffer::zeros(rows * layer.outputs())).collect()
    }

    fn head(&self, rows: usize) -> Head<T> {
        Head { joined: Buffer::zeros(rows * self.linear[0].inputs()), outputs: self.outputs(rows) }
    }

    /// The predictions for a batch, `[rows][outputs]`: displacement by displacement, north before east.
    pub fn forward<'s>(
        &self,
        compute: &mut Compute,
        batch: Batch<'_, T>,
        state: &'s mut NetworkState<T>,
    ) -> &'s [T] {
        let Batch { histories, anchors, rows } = batch;
        let steps = histories.len() / (rows.max(1) * COORDINATES);
        self.lstm.forward(compute, &self.parameters, histories, steps, rows, None, &mut state.lstm);
        state.lstm.read_last(None, &mut state.head.joined, self.linear[0].inputs());
        self.head_forward(compute, anchors, rows, &mut state.head)
    }

    /// From the last hidden states in `head` to the predictions.
    fn head_forward<'s>(
        &self,
        compute: &mut Compute,
        anchors: &[T],
        rows: usize,
        head: &'s mut Head<T>,
    ) -> &'s [T] {
        if self.config.anchored {
            let anchors = anchors.as_chunks::<COORDINATES>().0;
            for (joined, anchor) in head.joined.chunks_mut(self.linear[0].inputs()).zip(&anchors[..rows]) {
                joined[self.config.hidden..].copy_from_slice(anchor);
            }
        }
        for (index, layer) in self.linear.iter().enumerate() {
            let (before, from_here) = head.outputs.split_at_mut(index);
            let input = before.last().unwrap_or(&head.joined);
            layer.forward(compute, &self.parameters, input, rows, &mut from_here[0]);
        }
        &head.outputs[self.linear.len() - 1][..rows * self.config.outputs()]
    }

    /// Buffers for the rollout of up to `rows` paths.
    pub fn rollout(&self, rows: usize) -> Rollout<T> {
        let NetworkConfig { steps, predicted, .. } = self.config;
        Rollout { lstm: self.lstm.windows(steps, predicted, rows), head: self.head(rows) }
    }

    /// Starts a rollout of `calls` calls over `rows` paths.
    pub fn begin(&self, compute: &Compute, calls: usize, rows: usize, rollout: &mut Rollout<T>) {
        self.lstm.begin(compute, &self.parameters, (calls, rows), &mut rollout.lstm);
    }

    /// Takes the next displacement of every path, `[rows][2]`, an observed one or one that it predicted; the
    /// predictions of the call whose history this completes, as [`forward`](Self::forward) would give them.
    pub fn take<'s>(
        &self,
        compute: &mut Compute,
        displacements: &[T],
        anchors: &[T],
        rollout: &'s mut Rollout<T>,
    ) -> Option<&'s [T]> {
        self.lstm.slide(compute, &self.parameters, displacements, &mut rollout.lstm);
        let rows = displacements.len() / COORDINATES;
        let complete = rollout.lstm.read_complete(&mut rollout.head.joined, self.linear[0].inputs());
        complete.then(|| self.head_forward(compute, anchors, rows, &mut rollout.head))
    }

    /// The mean squared error of a batch against `targets[rows][outputs]`; its gradients are added.
    pub fn accumulate_gradients(
        &self,
        compute: &mut Compute,
        batch: Batch<'_, T>,
        targets: &[T],
        state: &mut NetworkState<T>,
        gradients: &mut Gradients<T>,
    ) -> f64 {
        self.forward(compute, batch, state);
        let last = self.linear.len() - 1;
        let count = batch.rows * self.config.outputs();
        let output = &state.head.outputs[last][..count];
        let loss = mean_squared_error(output, &targets[..count], &mut state.d_outputs[last][..count]);
        self.backward(compute, batch, state, None, gradients);
        loss
    }

    /// The output of the last [`forward`](Self::forward) and the place for the derivative of a loss with
    /// respect to it, both `[rows][outputs]`, before [`backward`](Self::backward).
    pub fn loss_buffers<'s>(&self, rows: usize, state: &'s mut NetworkState<T>) -> (&'s [T], &'s mut [T]) {
        let last = self.linear.len() - 1;
        let count = rows * self.config.outputs();
        (&state.head.outputs[last][..count], &mut state.d_outputs[last][..count])
    }

    /// Adds the gradients of a loss of the caller's own, whose derivative stands in
    /// [`loss_buffers`](Self::loss_buffers); fills those with respect to the inputs, if asked for.
    pub fn backward(
        &self,
        compute: &mut Compute,
        batch: Batch<'_, T>,
        state: &mut NetworkState<T>,
        inputs: Option<InputGradients<'_, T>>,
        gradients: &mut Gradients<T>,
    ) {
        let Batch { histories, rows, .. } = batch;
        for (index, layer) in self.linear.iter().enumerate().rev() {
            let input = if index == 0 { &state.head.joined } else { &state.head.outputs[index - 1] };
            let (before, from_here) = state.d_outputs.split_at_mut(index);
            let d_input = before.last_mut().unwrap_or(&mut state.d_joined);
            layer.backward(
                compute,
                &self.parameters,
                input,
                &state.head.outputs[index],
                rows,
                &mut from_here[0],
                Some(d_input),
                Some(gradients),
            );
        }
        let width = self.linear[0].inputs();
        let mut d_histories = None;
        if let Some(InputGradients { histories, anchors }) = inputs {
            if self.config.anchored {
                let d_anchors = anchors.as_chunks_mut::<COORDINATES>().0;
                for (joined, d_anchor) in state.d_joined.chunks(width).zip(&mut d_anchors[..rows]) {
                    d_anchor.copy_from_slice(&joined[self.config.hidden..]);
                }
            }
            d_histories = Some(histories);
        }
        self.lstm.backward(
            compute,
            &self.parameters,
            histories,
            None,
            &mut state.lstm,
            (&state.d_joined, width),
            d_histories,
            Some(gradients),
        );
    }
}

/// Sizes beyond this are taken for damage to the file, not for a network.
const LARGEST_SIZE: usize = 1 << 16;
