//! An agent: one of the two algorithms behind one interface, with the memory of its episode.

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::networks::{History, RecurrentNet};
use super::replay::Batch;
use super::sac::{Sac, SacConfig};
use super::td3::{Td3, Td3Config};
use crate::nn::{Adam, Compute, Parameters};

/// The learning algorithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Algorithm {
    /// Twin delayed deterministic policy gradient with recurrent networks.
    LstmTd3,
    /// Soft actor-critic with recurrent networks.
    #[default]
    LstmSac,
}

/// What both algorithms need.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AgentConfig {
    /// The learning algorithm.
    pub algorithm: Algorithm,
    /// Length `l` of the history.
    pub history_len: usize,
    /// Units of every hidden layer.
    pub hidden: usize,
    /// Transitions in one update.
    pub batch_size: usize,
    /// Hyperparameters of LSTM-TD3.
    pub td3: Td3Config,
    /// Hyperparameters of LSTM-SAC.
    pub sac: SacConfig,
}

impl Default for AgentConfig {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::default(),
            history_len: 4,
            hidden: 128,
            batch_size: 32,
            td3: Td3Config::default(),
            sac: SacConfig::default(),
        }
    }
}

/// A number that an update reports, under the tag that users of Stable-Baselines3 know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scalar {
    /// The tag, such as `train/critic_loss`.
    pub tag: &'static str,
    /// The value.
    pub value: f64,
}

/// The latest observations of an episode, the present one not among them.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    observations: Vec<f32>,
    observation_len: usize,
    length: [usize; 1],
}

impl Memory {
    /// Empty, for up to `history_len` observations.
    #[must_use]
    pub fn new(observation_len: usize, history_len: usize) -> Self {
        Self { observations: vec![0.0; observation_len * history_len], observation_len, length: [0] }
    }

    /// Forgets everything: an episode begins.
    pub fn clear(&mut self) {
        self.length = [0];
        self.observations.fill(0.0);
    }

    /// Takes the observation that has just become the past; the oldest goes where there is no room.
    pub fn push(&mut self, observation: &[f32]) {
        let n = self.observation_len;
        if self.observations.is_empty() {
            return;
        }
        if self.length[0] * n == self.observations.len() {
            self.observations.copy_within(n.., 0);
            self.length[0] -= 1;
        }
        self.observations[self.length[0] * n..][..n].copy_from_slice(observation);
        self.length[0] += 1;
    }

    /// As the history of a batch of one.
    #[must_use]
    pub fn history(&self) -> History<'_, f32> {
        History { observations: &self.observations, lengths: &self.length }
    }
}

/// One of the two algorithms.
#[derive(Debug, Clone)]
enum Learner {
    Td3(Box<Td3<f32>>),
    Sac(Box<Sac<f32>>),
}

/// A learning agent.
#[derive(Debug, Clone)]
pub struct Agent {
    config: AgentConfig,
    learner: Learner,
    noise: Vec<f32>,
    next_noise: Vec<f32>,
}

/// Weights and moments of one network of an agent, to be written to a checkpoint or filled from one.
#[derive(Debug)]
pub struct NetworkState<'a> {
    /// `actor`, `critic_1` or `critic_2`.
    pub name: &'static str,
    /// The weights that learn.
    pub online: &'a mut Parameters<f32>,
    /// The weights that follow them; LSTM-SAC does not use the actor's.
    pub target: &'a mut Parameters<f32>,
    /// The optimiser.
    pub adam: &'a mut Adam<f32>,
}

impl Agent {
    /// An untrained agent.
    #[must_use]
    pub fn new(config: AgentConfig, observation_len: usize, action_len: usize, rng: &mut impl Rng) -> Self {
        let sizes = (config.history_len, config.batch_size);
        let learner = match config.algorithm {
            Algorithm::LstmTd3 => Learner::Td3(Box::new(Td3::new(
                config.td3,
                observation_len,
                action_len,
                config.hidden,
                sizes,
                rng,
            ))),
            Algorithm::LstmSac => Learner::Sac(Box::new(Sac::new(
                config.sac,
                observation_len,
                action_len,
                config.hidden,
                sizes,
                rng,
            ))),
        };
        let noise = vec![0.0; config.batch_size * action_len];
        Self { learner, next_noise: noise.clone(), noise, config }
    }

    /// Its configuration.
    #[must_use]
    pub fn config(&self) -> &AgentConfig {
        &self.config
    }

    /// Updates made so far.
    #[must_use]
    pub fn updates(&self) -> u64 {
        match &self.learner {
            Learner::Td3(td3) => td3.updates(),
            Learner::Sac(sac) => sac.updates(),
        }
    }

    /// The deterministic action: TD3's policy, the `tanh` of SAC's mean.
    pub fn act(&mut self, compute: &mut Compute, observation: &[f32], memory: &Memory, action: &mut [f32]) {
        match &mut self.learner {
            Learner::Td3(td3) => action.copy_from_slice(td3.act(compute, observation, memory.history())),
            Learner::Sac(sac) => sac.act(compute, observation, memory.history(), action),
        }
    }

    /// An action with exploration.
    pub fn explore(
        &mut self,
        compute: &mut Compute,
        observation: &[f32],
        memory: &Memory,
        rng: &mut ChaCha8Rng,
        action: &mut [f32],
    ) {
        match &mut self.learner {
            Learner::Td3(td3) => td3.explore(compute, observation, memory.history(), rng, action),
            Learner::Sac(sac) => sac.explore(compute, observation, memory.history(), rng, action),
        }
    }

    /// Layers and weights of the policy, and whether its outputs are the means of a Gaussian, to be squashed,
    /// and what follows them.
    pub(super) fn policy(&self) -> (&RecurrentNet, &Parameters<f32>, bool) {
        match &self.learner {
            Learner::Td3(td3) => (td3.actor.net(), &td3.actor.online, false),
            Learner::Sac(sac) => (sac.actor.net(), &sac.actor.online, true),
        }
    }

    /// One update on a batch; writes what it reports to `scalars`.
    pub fn update(
        &mut self,
        compute: &mut Compute,
        batch: &Batch,
        rng: &mut ChaCha8Rng,
        scalars: &mut Vec<Scalar>,
    ) {
        let mut fill = |noise: &mut [f32]| noise.fill_with(|| rng.sample(StandardNormal));
        fill(&mut self.next_noise);
        scalars.clear();
        let mut report = |tag, value| scalars.push(Scalar { tag, value });
        match &mut self.learner {
            Learner::Td3(td3) => {
                let losses = td3.update(compute, batch, &self.next_noise);
                report("train/critic_loss", losses.critics[0] + losses.critics[1]);
                if let Some(loss) = losses.actor {
                    report("train/actor_loss", loss);
                }
            }
            Learner::Sac(sac) => {
                fill(&mut self.noise);
                let losses = sac.update(compute, batch, &self.next_noise, &self.noise);
                report("train/critic_loss", losses.critics[0] + losses.critics[1]);
                report("train/actor_loss", losses.actor);
                report("train/ent_coef_loss", losses.temperature_loss);
                report("train/ent_coef", losses.temperature);
            }
        }
    }

    /// All networks, to be written to a checkpoint or filled from one.
    pub fn networks(&mut self) -> [NetworkState<'_>; 3] {
        let (actor, critics) = match &mut self.learner {
            Learner::Td3(td3) => (&mut td3.actor, &mut td3.critics),
            Learner::Sac(sac) => (&mut sac.actor, &mut sac.critics),
        };
        let [first, second] = &mut critics.critics;
        [
            NetworkState {
                name: "actor",
                online: &mut actor.online,
                target: &mut actor.target,
                adam: &mut actor.adam,
            },
            NetworkState {
                name: "critic_1",
                online: &mut first.online,
                target: &mut first.target,
                adam: &mut first.adam,
            },
            NetworkState {
                name: "critic_2",
                online: &mut second.online,
                target: &mut second.target,
                adam: &mut second.adam,
            },
        ]
    }

    /// What the networks do not hold.
    #[must_use]
    pub fn counters(&self) -> AgentCounters {
        let temperature = match &self.learner {
            Learner::Td3(_) => None,
            Learner::Sac(sac) => Some(sac.temperature),
        };
        AgentCounters { updates: self.updates(), temperature }
    }

    /// Puts back what [`Self::counters`] gave.
    pub fn restore_counters(&mut self, counters: &AgentCounters) {
        match &mut self.learner {
            Learner::Td3(td3) => td3.restore_updates(counters.updates),
            Learner::Sac(sac) => {
                sac.restore_updates(counters.updates);
                if let Some(temperature) = counters.temperature {
                    sac.temperature = temperature;
                }
            }
        }
    }
}

/// State of an agent beside its networks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AgentCounters {
    /// Updates made so far.
    pub updates: u64,
    /// Temperature of LSTM-SAC.
    pub temperature: Option<super::sac::Temperature>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_keeps_the_latest_observations_in_order() {
        let mut memory = Memory::new(2, 3);
        assert_eq!(memory.history().lengths, &[0]);
        for t in 0..5 {
            memory.push(&[t as f32, 0.5]);
        }
        assert_eq!(memory.history().lengths, &[3]);
        assert_eq!(memory.history().observations, &[2.0, 0.5, 3.0, 0.5, 4.0, 0.5]);
        memory.clear();
        memory.push(&[9.0, 0.5]);
        assert_eq!(memory.history().lengths, &[1]);
        assert_eq!(&memory.history().observations[..2], &[9.0, 0.5]);
    }

    #[test]
    fn a_memory_without_room_stays_empty() {
        let mut memory = Memory::new(2, 0);
        memory.push(&[1.0, 2.0]);
        assert_eq!(memory.history().lengths, &[0]);
    }
}
