//! LSTM-TD3 (Meng, Gorbet, Kulić 2021; TD3: Fujimoto, van Hoof, Meger 2018).
//!
//! The histories hold no past actions (paper, section "Recurrent reinforcement learning").

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::actor::Actor;
use super::critics::{TwinCritics, bootstrap, history, next_history};
use super::networks::History;
use super::replay::Batch;
use crate::nn::{Activation, Compute, Real};

/// Hyperparameters; the defaults are the paper's (table "List of hyperparameters of the RL
/// algorithms") and those of its published code.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Td3Config {
    /// Discount factor `gamma`.
    pub discount: f64,
    /// Adam's rate for the actor.
    pub actor_learning_rate: f64,
    /// Adam's rate for both critics.
    pub critic_learning_rate: f64,
    /// Share by which targets follow in one update.
    pub target_rate: f64,
    /// Standard deviation of the noise on the target's action.
    pub target_noise_sd: f64,
    /// Bound of that noise.
    pub target_noise_clip: f64,
    /// Updates of the critics per update of the actor and of all targets; the first updates both.
    pub policy_delay: u64,
    /// Standard deviation of the noise on explored actions.
    pub exploration_noise_sd: f64,
    /// Updates of the critics alone before the actor's first; without, it follows their first guess.
    pub critic_only_updates: u64,
    /// Weight of `mean |mu(o, h)|^2` in the actor's loss; it keeps the `tanh` from one end where the critics hardly tell
    /// actions apart.
    pub action_penalty: f64,
}

impl Default for Td3Config {
    fn default() -> Self {
        Self {
            discount: 0.99,
            actor_learning_rate: 1e-4,
            critic_learning_rate: 1e-4,
            target_rate: 0.001,
            target_noise_sd: 0.2,
            target_noise_clip: 0.5,
            policy_delay: 2,
            exploration_noise_sd: 0.1,
            critic_only_updates: 0,
            action_penalty: 0.0,
        }
    }
}

/// Losses of one update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Td3Losses {
    /// Mean squared error of either critic.
    pub critics: [f64; 2],
    /// `-mean Q_1(o, mu(o, h), h)`, where the actor was updated.
    pub actor: Option<f64>,
}

/// Actor, critics, targets and optimisers.
#[derive(Debug, Clone)]
pub struct Td3<T> {
    config: Td3Config,
    /// `mu(o, h)` and its target.
    pub actor: Actor<T>,
    /// `Q_1`, `Q_2` and their targets.
    pub critics: TwinCritics<T>,
    updates: u64,
    next_action: Vec<T>,
    target: Vec<T>,
    d_action: Vec<T>,
}

impl<T: Real> Td3<T> {
    /// Networks with PyTorch's default initialisation, targets equal to them.
    #[must_use]
    pub fn new(
        config: Td3Config,
        observation_len: usize,
        action_len: usize,
        hidden: usize,
        (history_len, rows): (usize, usize),
        rng: &mut impl Rng,
    ) -> Self {
        let sizes = (history_len, rows);
        Self {
            config,
            actor: Actor::new((observation_len, action_len, hidden), Activation::Tanh, sizes, rng),
            critics: TwinCritics::new(observation_len, action_len, hidden, sizes, rng),
            updates: 0,
            next_action: vec![T::ZERO; rows * action_len],
            target: vec![T::ZERO; rows],
            d_action: vec![T::ZERO; rows * action_len],
        }
    }

    /// Updates made so far.
    #[must_use]
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Puts the count of updates back, to resume.
    pub fn restore_updates(&mut self, updates: u64) {
        self.updates = updates;
    }

    /// One update on a batch. `noise[rows][action_len]` is standard normal.
    pub fn update(&mut self, compute: &mut Compute, batch: &Batch<T>, noise: &[T]) -> Td3Losses {
        let config = self.config;

        // a' = clip(mu'(o', h') + clip(epsilon, -c, c), -1, 1)
        let proposed = self.actor.target_output(compute, &batch.next_observation, next_history(batch));
        for ((next, &action), &noise) in self.next_action.iter_mut().zip(proposed).zip(noise) {
            let noise = clip(T::from_f64(config.target_noise_sd) * noise, config.target_noise_clip);
            *next = clip(action + noise, 1.0);
        }

        // y = r + gamma min(Q_1', Q_2')(o', a', h')
        self.critics.evaluate(compute, batch, &self.next_action, &mut self.target);
        bootstrap(batch, config.discount, &mut self.target);
        let critics = self.critics.learn(compute, batch, &self.target, config.critic_learning_rate);

        let delayed = self.updates.is_multiple_of(config.policy_delay);
        let actor = (delayed && self.updates >= config.critic_only_updates).then(|| {
            let loss = self.update_actor(compute, batch);
            self.actor.follow(compute, config.target_rate);
            loss
        });
        if delayed {
            self.critics.follow(compute, config.target_rate);
        }
        self.updates += 1;
        Td3Losses { critics, actor }
    }

    /// Up the gradient of `mean Q_1(o, mu(o, h), h)`, less the penalty on actions; returns the loss without it.
    fn update_actor(&mut self, compute: &mut Compute, batch: &Batch<T>) -> f64 {
        let action = self.actor.forward(compute, &batch.observation, history(batch));
        let value = self.critics.first_value(compute, batch, action, &mut self.d_action);
        let pull = T::from_f64(2.0 * self.config.action_penalty / self.target.len() as f64);
        let (action, d_output) = self.actor.output_and_gradient();
        for ((d_output, &d_action), &action) in d_output.iter_mut().zip(&self.d_action).zip(action) {
            *d_output = pull * action - d_action;
        }
        self.actor.learn(compute, history(batch), self.config.actor_learning_rate);
        -value
    }

    /// `mu(o, h)` of one observation.
    pub fn act(&mut self, compute: &mut Compute, observation: &[T], past: History<'_, T>) -> &[T] {
        self.actor.act(compute, observation, past)
    }

    /// `clip(mu(o, h) + N(0, sigma^2), -1, 1)` of one observation.
    pub fn explore(
        &mut self,
        compute: &mut Compute,
        observation: &[T],
        past: History<'_, T>,
        rng: &mut impl Rng,
        action: &mut [T],
    ) {
        let sd = self.config.exploration_noise_sd;
        for (explored, &greedy) in action.iter_mut().zip(self.actor.act(compute, observation, past)) {
            let noise: f64 = rng.sample(StandardNormal);
            *explored = clip(greedy + T::from_f64(sd * noise), 1.0);
        }
    }
}

fn clip<T: Real>(value: T, bound: f64) -> T {
    let bound = T::from_f64(bound);
    if value > bound {
        bound
    } else if value < T::ZERO - bound {
        T::ZERO - bound
    } else {
        value
    }
}
