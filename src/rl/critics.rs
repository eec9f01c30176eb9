//! Twin critics and their targets, which LSTM-TD3 and LSTM-SAC share.

use rand::Rng;

use super::networks::{History, RecurrentBuffers, RecurrentNet, RecurrentShape};
use super::replay::Batch;
use crate::nn::{Activation, Adam, AdamConfig, Compute, Gradients, Parameters, Real, mean_squared_error};

/// One critic `Q(o, a, h)`, its target and its optimiser.
#[derive(Debug, Clone)]
pub struct Critic<T> {
    net: RecurrentNet,
    /// The weights that learn.
    pub online: Parameters<T>,
    /// The weights that follow them.
    pub target: Parameters<T>,
    /// Moments of the online weights' gradients.
    pub adam: Adam<T>,
    gradients: Gradients<T>,
    buffers: RecurrentBuffers<T>,
    target_buffers: RecurrentBuffers<T>,
}

/// Two critics that are trained on the same targets; the smaller of their values counts.
#[derive(Debug, Clone)]
pub struct TwinCritics<T> {
    /// `Q_1` and `Q_2`.
    pub critics: [Critic<T>; 2],
}

impl<T: Real> Critic<T> {
    fn new(shape: RecurrentShape, history_len: usize, rows: usize, rng: &mut impl Rng) -> Self {
        let net = RecurrentNet::new(shape);
        let online = Parameters::initialised(net.layout(), rng);
        Self {
            target: online.frozen(),
            adam: Adam::new(net.layout(), AdamConfig::default()),
            gradients: Gradients::zeros(net.layout()),
            buffers: net.buffers(history_len, rows),
            target_buffers: net.buffers(history_len, rows),
            online,
            net,
        }
    }

    /// The gradients of the last step.
    #[must_use]
    pub fn gradients(&self) -> &Gradients<T> {
        &self.gradients
    }

    /// Its layers.
    #[must_use]
    pub fn net(&self) -> &RecurrentNet {
        &self.net
    }

    fn evaluate(&mut self, compute: &mut Compute, batch: &Batch<T>, next_action: &[T]) {
        self.net.forward(
            compute,
            &self.target,
            &batch.next_observation,
            next_action,
            next_history(batch),
            &mut self.target_buffers,
        );
        self.value(compute, batch, &batch.action);
    }

    fn value(&mut self, compute: &mut Compute, batch: &Batch<T>, action: &[T]) {
        let Self { net, online, buffers, .. } = self;
        net.forward(compute, online, &batch.observation, action, history(batch), buffers);
    }

    fn learn(&mut self, compute: &mut Compute, batch: &Batch<T>, targets: &[T], learning_rate: f64) -> f64 {
        let (values, d_values) = self.buffers.output_and_gradient();
        let loss = mean_squared_error(values, targets, d_values);
        self.gradients.clear();
        self.net.backward(compute, &self.online, history(batch), &mut self.buffers, &mut self.gradients);
        self.adam.step(compute, &mut self.online, &self.gradients, learning_rate);
        loss
    }

    /// Gradient of the sum of `d_values[row] Q(row)` with respect to the action of the last
    /// evaluation.
    fn action_gradient(&mut self, compute: &mut Compute, d_values: &[T], d_action: &mut [T]) {
        self.buffers.d_output().copy_from_slice(d_values);
        self.net.backward_to_action(compute, &self.online, &mut self.buffers, d_action);
    }
}

impl<T: Real> TwinCritics<T> {
    /// Two critics with different weights, each target equal to its critic.
    #[must_use]
    pub fn new(
        observation_len: usize,
        action_len: usize,
        hidden: usize,
        (history_len, rows): (usize, usize),
        rng: &mut impl Rng,
    ) -> Self {
        let output_activation = Activation::Identity;
        let shape = RecurrentShape { observation_len, action_len, hidden, outputs: 1, output_activation };
        let mut critic = || Critic::new(shape, history_len, rows, rng);
        Self { critics: [critic(), critic()] }
    }

    /// Computes `Q(o, a, h)` and `Q'(o', a', h')` of both critics, each on a thread of its own where
    /// there are two; writes `min(Q_1', Q_2')` to `next_values[rows]`.
    pub fn evaluate(
        &mut self,
        compute: &mut Compute,
        batch: &Batch<T>,
        next_action: &[T],
        next_values: &mut [T],
    ) {
        let [first, second] = &mut self.critics;
        compute.join(
            |compute| first.evaluate(compute, batch, next_action),
            |compute| second.evaluate(compute, batch, next_action),
        );
        let pairs = first.target_buffers.output().iter().zip(second.target_buffers.output());
        for (next, (&first, &second)) in next_values.iter_mut().zip(pairs) {
            *next = if second < first { second } else { first };
        }
    }

    /// One step of both critics towards `targets[rows]`, after [`Self::evaluate`]; their losses.
    pub fn learn(
        &mut self,
        compute: &mut Compute,
        batch: &Batch<T>,
        targets: &[T],
        learning_rate: f64,
    ) -> [f64; 2] {
        let [first, second] = &mut self.critics;
        let losses = compute.join(
            |compute| first.learn(compute, batch, targets, learning_rate),
            |compute| second.learn(compute, batch, targets, learning_rate),
        );
        losses.into()
    }

    /// `Q_1(o, a, h)`, and in `d_action` the gradient of its mean.
    pub fn first_value(
        &mut self,
        compute: &mut Compute,
        batch: &Batch<T>,
        action: &[T],
        d_action: &mut [T],
    ) -> f64 {
        let critic = &mut self.critics[0];
        critic.value(compute, batch, action);
        let share = T::from_f64(1.0 / batch.rows as f64);
        critic.buffers.d_output().fill(share);
        critic.net.backward_to_action(compute, &critic.online, &mut critic.buffers, d_action);
        mean(critic.buffers.output())
    }

    /// The mean of `min(Q_1, Q_2)(o, a, h)`, and in `d_action` its gradient; `scratch` has the size of
    /// `d_action`.
    pub fn least_value(
        &mut self,
        compute: &mut Compute,
        batch: &Batch<T>,
        action: &[T],
        d_action: &mut [T],
        scratch: &mut LeastValue<T>,
    ) -> f64 {
        let [first, second] = &mut self.critics;
        compute.join(
            |compute| first.value(compute, batch, action),
            |compute| second.value(compute, batch, action),
        );
        let share = T::from_f64(1.0 / batch.rows as f64);
        let mut sum = 0.0;
        for row in 0..batch.rows {
            let (one, two) = (first.buffers.output()[row], second.buffers.output()[row]);
            let first_is_least = one <= two;
            scratch.d_first[row] = if first_is_least { share } else { T::ZERO };
            scratch.d_second[row] = if first_is_least { T::ZERO } else { share };
            sum += if first_is_least { one.to_f64() } else { two.to_f64() };
        }
        let LeastValue { d_first, d_second, d_action_second } = scratch;
        let d_action_first = &mut *d_action;
        compute.join(
            |compute| first.action_gradient(compute, d_first, d_action_first),
            |compute| second.action_gradient(compute, d_second, d_action_second),
        );
        for (sum, &share) in d_action.iter_mut().zip(scratch.d_action_second.iter()) {
            *sum += share;
        }
        sum / batch.rows as f64
    }

    /// Lets both targets follow their critics.
    pub fn follow(&mut self, compute: &mut Compute, rate: f64) {
        for critic in &mut self.critics {
            critic.target.follow(compute, &critic.online, rate);
        }
    }
}

/// Buffers of [`TwinCritics::least_value`].
#[derive(Debug, Clone)]
pub struct LeastValue<T> {
    d_first: Vec<T>,
    d_second: Vec<T>,
    d_action_second: Vec<T>,
}

impl<T: Real> LeastValue<T> {
    /// For batches of `rows` rows.
    #[must_use]
    pub fn new(rows: usize, action_len: usize) -> Self {
        Self {
            d_first: vec![T::ZERO; rows],
            d_second: vec![T::ZERO; rows],
            d_action_second: vec![T::ZERO; rows * action_len],
        }
    }
}

/// `h_t` of a batch.
pub fn history<T>(batch: &Batch<T>) -> History<'_, T> {
    History { observations: &batch.history, lengths: &batch.history_lengths }
}

/// `h_{t+1}` of a batch.
pub fn next_history<T>(batch: &Batch<T>) -> History<'_, T> {
    History { observations: &batch.next_history, lengths: &batch.next_history_lengths }
}

/// `y = r + discount * continues * next`, in place of `next`.
pub fn bootstrap<T: Real>(batch: &Batch<T>, discount: f64, next_to_target: &mut [T]) {
    let discount = T::from_f64(discount);
    for (row, value) in next_to_target.iter_mut().enumerate() {
        *value = batch.reward[row] + discount * batch.continues[row] * *value;
    }
}

/// The mean, summed in f64.
pub fn mean<T: Real>(values: &[T]) -> f64 {
    values.iter().map(|value| value.to_f64()).sum::<f64>() / values.len() as f64
}
