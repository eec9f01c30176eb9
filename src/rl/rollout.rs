//! Many episodes at once: copies of an environment side by side, one batch of the policy for all of them.
//!
//! Copies step in parallel on rayon's threads; the policy answers all of them in one forward pass. An episode
//! depends on its seed alone: neither the number of threads nor that of copies changes a bit of it, since a
//! product of `nn` computes a row the same way whatever the batch.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::agent::Agent;
use super::networks::{History, RecurrentBuffers, RecurrentNet};
use crate::env::{ActionError, Env};
use crate::nn::{Compute, Parameters};

/// Chooses the actions of many environments at once, one per row.
pub trait BatchPolicy {
    /// An episode begins in a row: what is remembered of the row is forgotten. What the policy draws at random
    /// follows from `seed`.
    fn begin(&mut self, row: usize, seed: u64);

    /// Fills `actions[rows][action_len]` for `observations[rows][observation_len]`. Rows whose environments rest
    /// hold their last observation.
    fn act(&mut self, observations: &[f32], actions: &mut [f32]);
}

/// An episode that has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct RolledEpisode<R> {
    /// Its seed.
    pub seed: u64,
    /// Sum of its rewards.
    pub total_reward: f64,
    /// Its decisions.
    pub decisions: u64,
    /// What was read off the environment at its end.
    pub outcome: R,
}

/// Copies of an environment.
pub struct Rollout<E> {
    slots: Vec<Slot<E>>,
    observations: Vec<f32>,
    actions: Vec<f32>,
}

/// One copy and the episode in it.
struct Slot<E> {
    env: E,
    observation: Vec<f32>,
    action: Vec<f32>,
    /// Index of the episode's seed; nothing where the copy rests.
    episode: Option<usize>,
    has_ended: bool,
    total_reward: f64,
    decisions: u64,
}

impl<E: Env> Rollout<E> {
    /// Over these copies, which have to be alike.
    ///
    /// # Panics
    ///
    /// Without a copy.
    #[must_use]
    pub fn new(copies: Vec<E>) -> Self {
        assert!(!copies.is_empty(), "a rollout needs an environment");
        let (observation_len, action_len) = (copies[0].observation_len(), copies[0].action_len());
        let rows = copies.len();
        let slot = |env| Slot {
            env,
            observation: vec![0.0; observation_len],
            action: vec![0.0; action_len],
            episode: None,
            has_ended: false,
            total_reward: 0.0,
            decisions: 0,
        };
        Self {
            slots: copies.into_iter().map(slot).collect(),
            observations: vec![0.0; rows * observation_len],
            actions: vec![0.0; rows * action_len],
        }
    }

    /// Number of copies.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.slots.len()
    }

    /// Runs one episode per seed; the results are in the order of the seeds. `outcome` reads an environment at
    /// the end of its episode, `finished` is told how many more episodes have ended.
    ///
    /// # Errors
    ///
    /// When an environment refuses an action of the policy.
    pub fn run<R: Send>(
        &mut self,
        policy: &mut dyn BatchPolicy,
        seeds: &[u64],
        outcome: impl Fn(&E) -> R + Sync,
        mut finished: impl FnMut(u64),
    ) -> Result<Vec<RolledEpisode<R>>, ActionError> {
        let mut ended: Vec<Option<RolledEpisode<R>>> = seeds.iter().map(|_| None).collect();
        let mut waiting = 0..seeds.len();
        for slot in &mut self.slots {
            slot.episode = None;
        }
        loop {
            for (row, slot) in self.slots.iter_mut().enumerate() {
                if slot.episode.is_none()
                    && let Some(index) = waiting.next()
                {
                    slot.episode = Some(index);
                    slot.has_ended = true;
                    policy.begin(row, seeds[index]);
                }
            }
            if self.slots.iter().all(|slot| slot.episode.is_none()) {
                break;
            }
            self.slots.par_iter_mut().for_each(|slot| slot.reset_if_new(seeds));
            self.ask(policy);
            let results: Vec<Option<(usize, RolledEpisode<R>)>> = self
                .slots
                .par_iter_mut()
                .map(|slot| slot.step(seeds, &outcome))
                .collect::<Result<_, ActionError>>()?;
            let before = ended.iter().flatten().count();
            for (index, episode) in results.into_iter().flatten() {
                ended[index] = Some(episode);
            }
            let count = ended.iter().flatten().count() - before;
            if count > 0 {
                finished(count as u64);
            }
        }
        Ok(ended.into_iter().flatten().collect())
    }

    /// One batch of the policy.
    fn ask(&mut self, policy: &mut dyn BatchPolicy) {
        let (n, m) = (self.slots[0].observation.len(), self.slots[0].action.len());
        for (slot, row) in self.slots.iter().zip(self.observations.chunks_mut(n)) {
            row.copy_from_slice(&slot.observation);
        }
        policy.act(&self.observations, &mut self.actions);
        for (slot, row) in self.slots.iter_mut().zip(self.actions.chunks(m)) {
            slot.action.copy_from_slice(row);
        }
    }
}

impl<E: Env> Slot<E> {
    fn reset_if_new(&mut self, seeds: &[u64]) {
        if let Some(index) = self.episode
            && self.has_ended
        {
            self.env.reset(seeds[index], &mut self.observation);
            (self.has_ended, self.total_reward, self.decisions) = (false, 0.0, 0);
        }
    }

    /// One decision; the episode, where it ends with it.
    fn step<R>(
        &mut self,
        seeds: &[u64],
        outcome: &impl Fn(&E) -> R,
    ) -> Result<Option<(usize, RolledEpisode<R>)>, ActionError> {
        let Some(index) = self.episode else { return Ok(None) };
        let step = self.env.step(&self.action, &mut self.observation)?;
        self.total_reward += step.reward;
        self.decisions += 1;
        if !step.ends_episode() {
            return Ok(None);
        }
        self.episode = None;
        let episode = RolledEpisode {
            seed: seeds[index],
            total_reward: self.total_reward,
            decisions: self.decisions,
            outcome: outcome(&self.env),
        };
        Ok(Some((index, episode)))
    }
}

/// The deterministic policy of an agent, with a history per row.
pub struct AgentBatch {
    net: RecurrentNet,
    parameters: Parameters<f32>,
    /// Whether the outputs are means, still to be squashed, and what follows them.
    is_gaussian: bool,
    buffers: RecurrentBuffers<f32>,
    compute: Compute,
    /// `[history_len][rows][observation_len]`, a row's valid steps first.
    history: Vec<f32>,
    lengths: Vec<usize>,
    history_len: usize,
}

impl AgentBatch {
    /// The policy of `agent` as it is now, for `rows` environments.
    #[must_use]
    pub fn new(agent: &Agent, rows: usize, compute: Compute) -> Self {
        let (net, parameters, is_gaussian) = agent.policy();
        let history_len = agent.config().history_len;
        let observation_len = net.shape().observation_len;
        Self {
            parameters: parameters.frozen(),
            is_gaussian,
            buffers: net.buffers(history_len, rows),
            compute,
            history: vec![0.0; history_len * rows * observation_len],
            lengths: vec![0; rows],
            history_len,
            net: net.clone(),
        }
    }

    /// Takes an observation that has just become the past of its row.
    fn remember(&mut self, row: usize, observation: &[f32]) {
        if self.history_len == 0 {
            return;
        }
        let (n, rows) = (observation.len(), self.lengths.len());
        let place = |step: usize| (step * rows + row) * n;
        if self.lengths[row] == self.history_len {
            for step in 1..self.history_len {
                self.history.copy_within(place(step)..place(step) + n, place(step - 1));
            }
            self.lengths[row] -= 1;
        }
        self.history[place(self.lengths[row])..][..n].copy_from_slice(observation);
        self.lengths[row] += 1;
    }
}

impl BatchPolicy for AgentBatch {
    fn begin(&mut self, row: usize, _seed: u64) {
        self.lengths[row] = 0;
        let (n, rows) = (self.net.shape().observation_len, self.lengths.len());
        for step in 0..self.history_len {
            self.history[(step * rows + row) * n..][..n].fill(0.0);
        }
    }

    fn act(&mut self, observations: &[f32], actions: &mut [f32]) {
        let past = History { observations: &self.history, lengths: &self.lengths };
        self.net.forward(&mut self.compute, &self.parameters, observations, &[], past, &mut self.buffers);
        let outputs = self.net.shape().outputs;
        let m = if self.is_gaussian { outputs / 2 } else { outputs };
        for (action, output) in actions.chunks_mut(m).zip(self.buffers.output().chunks(outputs)) {
            action.copy_from_slice(&output[..m]);
        }
        if self.is_gaussian {
            for action in actions {
                *action = f64::from(*action).tanh() as f32;
            }
        }
        let n = self.net.shape().observation_len;
        for (row, observation) in observations.chunks(n).enumerate() {
            self.remember(row, observation);
        }
    }
}

/// Every component of every action is zero.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoAction;

impl BatchPolicy for NoAction {
    fn begin(&mut self, _row: usize, _seed: u64) {}

    fn act(&mut self, _observations: &[f32], actions: &mut [f32]) {
        actions.fill(0.0);
    }
}

/// Every component of every action uniform on `[-1, 1]`.
#[derive(Debug, Clone)]
pub struct UniformActions(Vec<ChaCha8Rng>);

impl UniformActions {
    /// For `rows` environments.
    #[must_use]
    pub fn new(rows: usize) -> Self {
        Self((0..rows as u64).map(ChaCha8Rng::seed_from_u64).collect())
    }
}

impl BatchPolicy for UniformActions {
    fn begin(&mut self, row: usize, seed: u64) {
        /// Environments draw their episodes from the first streams of a seed.
        const STREAM: u64 = 1 << 32;
        self.0[row] = ChaCha8Rng::seed_from_u64(seed);
        self.0[row].set_stream(STREAM);
    }

    fn act(&mut self, _observations: &[f32], actions: &mut [f32]) {
        let m = actions.len() / self.0.len();
        for (rng, action) in self.0.iter_mut().zip(actions.chunks_mut(m)) {
            action.fill_with(|| rng.random_range(-1.0..=1.0));
        }
    }
}
