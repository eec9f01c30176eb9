//! LSTM-SAC: soft actor-critic (Haarnoja et al. 2018, arXiv 1812.05905) on the networks of LSTM-TD3,
//! with a learned temperature.

use std::f64::consts::{LN_2, PI};

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::actor::Actor;
use super::critics::{LeastValue, TwinCritics, bootstrap, history, mean, next_history};
use super::networks::History;
use super::replay::Batch;
use crate::nn::{Activation, Compute, Real};

/// Hyperparameters; the defaults are the paper's (table "List of hyperparameters of the RL
/// algorithms") and those of its published code.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SacConfig {
    /// Discount factor `gamma`.
    pub discount: f64,
    /// Adam's rate for the actor.
    pub actor_learning_rate: f64,
    /// Adam's rate for both critics.
    pub critic_learning_rate: f64,
    /// Adam's rate for the logarithm of the temperature.
    pub temperature_learning_rate: f64,
    /// Temperature `alpha` at the start.
    pub initial_temperature: f64,
    /// Entropy that the temperature is steered to.
    pub target_entropy: f64,
    /// Share by which targets follow in one update.
    pub target_rate: f64,
    /// Least value of the logarithm of a standard deviation.
    pub log_sd_min: f64,
    /// Greatest value of it.
    pub log_sd_max: f64,
}

impl Default for SacConfig {
    fn default() -> Self {
        Self {
            discount: 0.99,
            actor_learning_rate: 1e-4,
            critic_learning_rate: 1e-4,
            temperature_learning_rate: 1e-4,
            initial_temperature: 0.2,
            target_entropy: -1.0,
            target_rate: 0.001,
            log_sd_min: -20.0,
            log_sd_max: 2.0,
        }
    }
}

/// Losses of one update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SacLosses {
    /// Mean squared error of either critic.
    pub critics: [f64; 2],
    /// `mean(alpha log pi - min(Q_1, Q_2))`.
    pub actor: f64,
    /// `-log alpha * mean(log pi + target entropy)`.
    pub temperature_loss: f64,
    /// `alpha` after the update.
    pub temperature: f64,
}

/// The logarithm of the temperature and its moments under Adam.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Temperature {
    /// `log alpha`.
    pub log_alpha: f64,
    /// First moment of its gradient.
    pub first_moment: f64,
    /// Second moment of its gradient.
    pub second_moment: f64,
    /// Steps taken.
    pub steps: u64,
}

/// Actor, critics, targets, temperature and optimisers.
#[derive(Debug, Clone)]
pub struct Sac<T> {
    config: SacConfig,
    /// The policy `pi(o, h)`: outputs `[rows][2 action_len]`, means first, then logarithms of standard
    /// deviations (two heads in one layer).
    pub actor: Actor<T>,
    /// `Q_1`, `Q_2` and their targets.
    pub critics: TwinCritics<T>,
    /// `alpha`, learned in log space.
    pub temperature: Temperature,
    action_len: usize,
    updates: u64,
    next: Sample<T>,
    now: Sample<T>,
    target: Vec<T>,
    d_action: Vec<T>,
    least: LeastValue<T>,
}

/// Actions drawn from the policy for a batch.
#[derive(Debug, Clone)]
struct Sample<T> {
    /// `a = tanh(mean + sd * noise)`: `[rows][action_len]`.
    action: Vec<T>,
    /// `sd * noise` where the logarithm of `sd` was not clamped, 0 where it was: the derivative of the
    /// unsquashed action by that logarithm.
    slope: Vec<T>,
    /// Whether the logarithm of `sd` was within its bounds.
    free: Vec<bool>,
    /// `log pi(a | o, h)`: `[rows]`.
    log_probability: Vec<T>,
}

impl<T: Real> Sample<T> {
    fn new(rows: usize, action_len: usize) -> Self {
        Self {
            action: vec![T::ZERO; rows * action_len],
            slope: vec![T::ZERO; rows * action_len],
            free: vec![false; rows * action_len],
            log_probability: vec![T::ZERO; rows],
        }
    }

    /// Draws with standard normal `noise[rows][action_len]` from the policy's `output`.
    fn draw(&mut self, config: &SacConfig, output: &[T], noise: &[T]) {
        let action_len = self.action.len() / self.log_probability.len();
        for (row, log_probability) in self.log_probability.iter_mut().enumerate() {
            let (means, log_sds) = output[row * 2 * action_len..][..2 * action_len].split_at(action_len);
            let mut sum = 0.0;
            for component in 0..action_len {
                let at = row * action_len + component;
                let raw = log_sds[component].to_f64();
                let log_sd = raw.clamp(config.log_sd_min, config.log_sd_max);
                let noise = noise[at].to_f64();
                let deviation = log_sd.exp() * noise;
                let unsquashed = means[component].to_f64() + deviation;
                sum += -0.5 * noise * noise
                    - log_sd
                    - 0.5 * (2.0 * PI).ln()
                    - log_one_minus_tanh_squared(unsquashed);
                self.action[at] = T::from_f64(unsquashed.tanh());
                self.free[at] = raw == log_sd;
                self.slope[at] = T::from_f64(if raw == log_sd { deviation } else { 0.0 });
            }
            *log_probability = T::from_f64(sum);
        }
    }
}

impl<T: Real> Sac<T> {
    /// Networks with PyTorch's default initialisation, targets equal to them.
    #[must_use]
    pub fn new(
        config: SacConfig,
        observation_len: usize,
        action_len: usize,
        hidden: usize,
        (history_len, rows): (usize, usize),
        rng: &mut impl Rng,
    ) -> Self {
        let sizes = (history_len, rows);
        let outputs = 2 * action_len;
        let log_alpha = config.initial_temperature.ln();
        Self {
            config,
            actor: Actor::new((observation_len, outputs, hidden), Activation::Identity, sizes, rng),
            critics: TwinCritics::new(observation_len, action_len, hidden, sizes, rng),
            temperature: Temperature { log_alpha, first_moment: 0.0, second_moment: 0.0, steps: 0 },
            action_len,
            updates: 0,
            next: Sample::new(rows, action_len),
            now: Sample::new(rows, action_len),
            target: vec![T::ZERO; rows],
            d_action: vec![T::ZERO; rows * action_len],
            least: LeastValue::new(rows, action_len),
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

    /// One update on a batch. `next_noise` and `noise`, `[rows][action_len]`, are standard normal.
    pub fn update(
        &mut self,
        compute: &mut Compute,
        batch: &Batch<T>,
        next_noise: &[T],
        noise: &[T],
    ) -> SacLosses {
        let config = self.config;
        let alpha = self.temperature.log_alpha.exp();

        // y = r + gamma (min(Q_1', Q_2')(o', a', h') - alpha log pi(a' | o', h'))
        let output = self.actor.forward(compute, &batch.next_observation, next_history(batch));
        self.next.draw(&config, output, next_noise);
        self.critics.evaluate(compute, batch, &self.next.action, &mut self.target);
        for (value, &log_probability) in self.target.iter_mut().zip(&self.next.log_probability) {
            *value = *value - T::from_f64(alpha) * log_probability;
        }
        bootstrap(batch, config.discount, &mut self.target);
        let critics = self.critics.learn(compute, batch, &self.target, config.critic_learning_rate);

        let actor = self.update_actor(compute, batch, noise, alpha);

        let surplus = mean(&self.now.log_probability) + config.target_entropy;
        let temperature_loss = -self.temperature.log_alpha * surplus;
        self.temperature.step(-surplus, config.temperature_learning_rate);

        self.critics.follow(compute, config.target_rate);
        self.updates += 1;
        let temperature = self.temperature.log_alpha.exp();
        SacLosses { critics, actor, temperature_loss, temperature }
    }

    /// Down the gradient of `mean(alpha log pi - min(Q_1, Q_2))`, by reparameterisation.
    fn update_actor(&mut self, compute: &mut Compute, batch: &Batch<T>, noise: &[T], alpha: f64) -> f64 {
        let output = self.actor.forward(compute, &batch.observation, history(batch));
        self.now.draw(&self.config, output, noise);
        let Self { critics, now, d_action, least, .. } = self;
        let value = critics.least_value(compute, batch, &now.action, d_action, least);

        let share = T::from_f64(alpha / batch.rows as f64);
        let two = T::from_f64(2.0);
        let m = self.action_len;
        let d_output = self.actor.d_output();
        for (at, (&action, &d_value)) in self.now.action.iter().zip(&self.d_action).enumerate() {
            // With u unsquashed: d log pi / du = 2 tanh u, da / du = 1 - tanh^2 u.
            let d_unsquashed = share * two * action - d_value * (T::ONE - action * action);
            let (row, component) = (at / m, at % m);
            let entropy = if self.now.free[at] { share } else { T::ZERO };
            d_output[row * 2 * m + component] = d_unsquashed;
            d_output[row * 2 * m + m + component] = d_unsquashed * self.now.slope[at] - entropy;
        }
        self.actor.learn(compute, history(batch), self.config.actor_learning_rate);
        alpha * mean(&self.now.log_probability) - value
    }

    /// `tanh` of the policy's mean for one observation.
    pub fn act(&mut self, compute: &mut Compute, observation: &[T], past: History<'_, T>, action: &mut [T]) {
        let output = self.actor.act(compute, observation, past);
        for (action, mean) in action.iter_mut().zip(output) {
            *action = T::from_f64(mean.to_f64().tanh());
        }
    }

    /// An action drawn from the policy for one observation.
    pub fn explore(
        &mut self,
        compute: &mut Compute,
        observation: &[T],
        past: History<'_, T>,
        rng: &mut impl Rng,
        action: &mut [T],
    ) {
        let SacConfig { log_sd_min, log_sd_max, .. } = self.config;
        let output = self.actor.act(compute, observation, past);
        let (means, log_sds) = output.split_at(action.len());
        for ((action, mean), log_sd) in action.iter_mut().zip(means).zip(log_sds) {
            let noise: f64 = rng.sample(StandardNormal);
            let sd = log_sd.to_f64().clamp(log_sd_min, log_sd_max).exp();
            *action = T::from_f64((mean.to_f64() + sd * noise).tanh());
        }
    }
}

impl Temperature {
    /// Adam with PyTorch's defaults.
    fn step(&mut self, gradient: f64, learning_rate: f64) {
        const BETA_1: f64 = 0.9;
        const BETA_2: f64 = 0.999;
        const EPSILON: f64 = 1e-8;
        self.steps += 1;
        self.first_moment = BETA_1 * self.first_moment + (1.0 - BETA_1) * gradient;
        self.second_moment = BETA_2 * self.second_moment + (1.0 - BETA_2) * gradient * gradient;
        let corrected = |beta: f64| 1.0 - beta.powf(self.steps as f64);
        let root = (self.second_moment / corrected(BETA_2)).sqrt() + EPSILON;
        self.log_alpha -= learning_rate * self.first_moment / corrected(BETA_1) / root;
    }
}

/// `log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2 u))`, which does not cancel for large `|u|`.
fn log_one_minus_tanh_squared(u: f64) -> f64 {
    let x = -2.0 * u;
    let softplus = x.max(0.0) + (-x.abs()).exp().ln_1p();
    2.0 * (LN_2 - u - softplus)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_squashing_term_is_stable() {
        for u in [-3.0, -0.5, 0.0, 0.1, 2.0_f64] {
            assert!((log_one_minus_tanh_squared(u) - (1.0 - u.tanh().powi(2)).ln()).abs() < 1e-12);
        }
        assert!((log_one_minus_tanh_squared(40.0) - (2.0 * LN_2 - 80.0)).abs() < 1e-12);
        assert!((log_one_minus_tanh_squared(-40.0) - (2.0 * LN_2 - 80.0)).abs() < 1e-12);
    }
}
