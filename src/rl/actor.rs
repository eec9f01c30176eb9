//! A recurrent actor with its optimiser, and with a target where the algorithm has one.

use rand::Rng;

use super::networks::{History, RecurrentBuffers, RecurrentNet, RecurrentShape};
use crate::nn::{Activation, Adam, AdamConfig, Compute, Gradients, Parameters, Real};

/// The network from observation and history to an action, or to the parameters of its distribution.
#[derive(Debug, Clone)]
pub struct Actor<T> {
    net: RecurrentNet,
    /// The weights that learn.
    pub online: Parameters<T>,
    /// The weights that follow them.
    pub target: Parameters<T>,
    /// Moments of the online weights' gradients.
    pub adam: Adam<T>,
    gradients: Gradients<T>,
    buffers: RecurrentBuffers<T>,
    single: RecurrentBuffers<T>,
}

impl<T: Real> Actor<T> {
    /// From lengths of observation and output and the units of hidden layers, for histories of up to
    /// `history_len` observations and batches of `rows` rows.
    #[must_use]
    pub fn new(
        (observation_len, outputs, hidden): (usize, usize, usize),
        output_activation: Activation,
        (history_len, rows): (usize, usize),
        rng: &mut impl Rng,
    ) -> Self {
        let shape = RecurrentShape { observation_len, action_len: 0, hidden, outputs, output_activation };
        let net = RecurrentNet::new(shape);
        let online = Parameters::initialised(net.layout(), rng);
        Self {
            target: online.frozen(),
            adam: Adam::new(net.layout(), AdamConfig::default()),
            gradients: Gradients::zeros(net.layout()),
            buffers: net.buffers(history_len, rows),
            single: net.buffers(history_len, 1),
            online,
            net,
        }
    }

    /// Its layers.
    #[must_use]
    pub fn net(&self) -> &RecurrentNet {
        &self.net
    }

    /// The gradients of the last step.
    #[must_use]
    pub fn gradients(&self) -> &Gradients<T> {
        &self.gradients
    }

    /// The output for a batch, `[rows][outputs]`.
    pub fn forward(&mut self, compute: &mut Compute, observation: &[T], past: History<'_, T>) -> &[T] {
        self.net.forward(compute, &self.online, observation, &[], past, &mut self.buffers);
        self.buffers.output()
    }

    /// The target network's output for a batch.
    pub fn target_output(&mut self, compute: &mut Compute, observation: &[T], past: History<'_, T>) -> &[T] {
        self.net.forward(compute, &self.target, observation, &[], past, &mut self.buffers);
        self.buffers.output()
    }

    /// The output for one observation.
    pub fn act(&mut self, compute: &mut Compute, observation: &[T], past: History<'_, T>) -> &[T] {
        self.net.forward(compute, &self.online, observation, &[], past, &mut self.single);
        self.single.output()
    }

    /// Gradient of the loss with respect to the output of the last [`Self::forward`].
    pub fn d_output(&mut self) -> &mut [T] {
        self.buffers.d_output()
    }

    /// Output of the last [`Self::forward`] and the gradient of the loss with respect to it.
    pub fn output_and_gradient(&mut self) -> (&[T], &mut [T]) {
        self.buffers.output_and_gradient()
    }

    /// One step down the gradient that lies in [`Self::d_output`].
    pub fn learn(&mut self, compute: &mut Compute, past: History<'_, T>, learning_rate: f64) {
        self.gradients.clear();
        self.net.backward(compute, &self.online, past, &mut self.buffers, &mut self.gradients);
        self.adam.step(compute, &mut self.online, &self.gradients, learning_rate);
    }

    /// Lets the target follow.
    pub fn follow(&mut self, compute: &mut Compute, rate: f64) {
        self.target.follow(compute, &self.online, rate);
    }
}
