//! The training loop, one decision at a time.
//!
//! A [`Trainer`] is a state machine without clock, files or output: whoever drives it shows progress,
//! writes logs and keeps checkpoints. Equal seeds give equal bits, and a trainer restored from its
//! [`TrainerState`] goes on with the bits it would have had.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::agent::{Agent, AgentConfig, AgentCounters, Memory, Scalar};
use super::replay::{Batch, Replay, ReplayShape};
use crate::env::{Env, SeedDomain};
use crate::nn::Compute;

/// How long and on what an agent is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainerConfig {
    /// Seed of everything random in the run.
    pub seed: u64,
    /// Frames that the replay keeps.
    pub replay_capacity: usize,
    /// Uniformly random decisions before the first update.
    pub random_steps: u64,
    /// Decisions between two evaluations.
    pub evaluate_every: u64,
    /// Episodes of one evaluation.
    pub evaluation_episodes: u64,
    /// Whether what follows the last decision before the time limit counts, at the critic's own estimate. Without
    /// it the limit ends an episode as a terminal state does.
    pub bootstrap_at_time_limit: bool,
    /// The agent.
    pub agent: AgentConfig,
}

impl Default for TrainerConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            replay_capacity: 1_000_000,
            random_steps: 5000,
            evaluate_every: 10_000,
            evaluation_episodes: 10,
            bootstrap_at_time_limit: true,
            agent: AgentConfig::default(),
        }
    }
}

/// Episodes that a trainer remembers the returns of, as many as Stable-Baselines3 averages over.
const RECENT_EPISODES: usize = 100;

/// An episode that has ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FinishedEpisode {
    /// Sum of its rewards.
    pub total_reward: f64,
    /// Its decisions.
    pub decisions: u64,
}

/// One evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Decisions trained on before it.
    pub step: u64,
    /// Sum of rewards of each episode.
    pub returns: Vec<f64>,
    /// Decisions of each episode.
    pub decisions: Vec<u64>,
}

impl Evaluation {
    /// The mean return.
    #[must_use]
    pub fn mean_return(&self) -> f64 {
        self.returns.iter().sum::<f64>() / self.returns.len() as f64
    }

    /// The mean number of decisions.
    #[must_use]
    pub fn mean_decisions(&self) -> f64 {
        self.decisions.iter().sum::<u64>() as f64 / self.decisions.len() as f64
    }
}

/// Everything a trainer holds beside networks and replay.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainerState {
    /// Decisions made.
    pub step: u64,
    /// Frames pushed to the replay.
    pub frames_pushed: u64,
    /// The stream behind exploration, replay draws and episode seeds.
    pub rng: ChaCha8Rng,
    /// Seed of the episode under way.
    pub episode_seed: u64,
    /// Actions taken in it, one after the other; replaying them restores the environment.
    pub episode_actions: Vec<f32>,
    /// The latest episodes, the oldest first.
    pub recent_episodes: VecDeque<FinishedEpisode>,
    /// State of the agent beside its networks.
    pub agent: AgentCounters,
}

/// Trains one agent in one environment.
pub struct Trainer {
    config: TrainerConfig,
    env: Box<dyn Env>,
    agent: Agent,
    replay: Replay,
    compute: Compute,
    rng: ChaCha8Rng,
    step: u64,
    episode_seed: u64,
    episode_actions: Vec<f32>,
    episode_reward: f64,
    recent_episodes: VecDeque<FinishedEpisode>,
    observation: Vec<f32>,
    next_observation: Vec<f32>,
    action: Vec<f32>,
    memory: Memory,
    batch: Batch,
    scalars: Vec<Scalar>,
}

impl Trainer {
    /// An untrained agent at the start of its first episode.
    #[must_use]
    pub fn new(config: TrainerConfig, env: Box<dyn Env>, compute: Compute) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        let (observation_len, action_len) = (env.observation_len(), env.action_len());
        let shape = ReplayShape { observation_len, action_len, capacity: config.replay_capacity };
        let mut trainer = Self {
            agent: Agent::new(config.agent.clone(), observation_len, action_len, &mut rng),
            replay: Replay::new(shape),
            compute,
            step: 0,
            episode_seed: 0,
            episode_actions: Vec::new(),
            episode_reward: 0.0,
            recent_episodes: VecDeque::with_capacity(RECENT_EPISODES),
            observation: vec![0.0; observation_len],
            next_observation: vec![0.0; observation_len],
            action: vec![0.0; action_len],
            memory: Memory::new(observation_len, config.agent.history_len),
            batch: Batch::new(&shape, config.agent.batch_size, config.agent.history_len),
            scalars: Vec::new(),
            rng,
            env,
            config,
        };
        trainer.begin_episode();
        trainer
    }

    /// Puts a trainer back to where [`Self::state`] was taken; the networks are filled through
    /// [`Self::agent`]. `false` where the environment refuses the recorded actions, which means that
    /// it is not the one they were taken in.
    #[must_use]
    pub fn restore(&mut self, state: TrainerState, replay: Replay) -> bool {
        self.step = state.step;
        self.replay = replay;
        self.agent.restore_counters(&state.agent);
        self.episode_seed = state.episode_seed;
        self.episode_actions.clear();
        self.episode_reward = 0.0;
        self.memory.clear();
        self.env.reset(state.episode_seed, &mut self.observation);
        for action in state.episode_actions.chunks(self.env.action_len()) {
            let Ok(step) = self.env.step(action, &mut self.next_observation) else { return false };
            self.episode_reward += step.reward;
            self.episode_actions.extend_from_slice(action);
            self.memory.push(&self.observation);
            std::mem::swap(&mut self.observation, &mut self.next_observation);
        }
        self.recent_episodes = state.recent_episodes;
        self.rng = state.rng;
        true
    }

    /// What a checkpoint holds beside networks and replay.
    #[must_use]
    pub fn state(&self) -> TrainerState {
        TrainerState {
            step: self.step,
            frames_pushed: self.replay.pushed(),
            rng: self.rng.clone(),
            episode_seed: self.episode_seed,
            episode_actions: self.episode_actions.clone(),
            recent_episodes: self.recent_episodes.clone(),
            agent: self.agent.counters(),
        }
    }

    /// Decisions made.
    #[must_use]
    pub fn step(&self) -> u64 {
        self.step
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &TrainerConfig {
        &self.config
    }

    /// The agent.
    pub fn agent(&mut self) -> &mut Agent {
        &mut self.agent
    }

    /// The replay.
    pub fn replay(&mut self) -> &mut Replay {
        &mut self.replay
    }

    /// What the last update reported; empty before the first.
    #[must_use]
    pub fn scalars(&self) -> &[Scalar] {
        &self.scalars
    }

    /// The latest 100 episodes, the oldest first.
    #[must_use]
    pub fn recent_episodes(&self) -> &VecDeque<FinishedEpisode> {
        &self.recent_episodes
    }

    /// One decision and, once the random ones are over, one update. Tells when an episode ended.
    ///
    /// # Panics
    ///
    /// When the environment refuses an action, which a trainer's actions give no cause for.
    pub fn advance(&mut self) -> Option<FinishedEpisode> {
        self.choose_action();
        let outcome = self.env.step(&self.action, &mut self.next_observation);
        let outcome = outcome.unwrap_or_else(|error| panic!("a trainer's action was refused: {error}"));
        let ends_value = outcome.terminated || (outcome.truncated && !self.config.bootstrap_at_time_limit);
        self.replay.push(&self.action, outcome.reward as f32, ends_value, &self.next_observation);
        self.episode_actions.extend_from_slice(&self.action);
        self.episode_reward += outcome.reward;
        self.memory.push(&self.observation);
        std::mem::swap(&mut self.observation, &mut self.next_observation);
        self.step += 1;
        if self.step > self.config.random_steps && self.replay.sample(&mut self.rng, &mut self.batch) {
            self.agent.update(&mut self.compute, &self.batch, &mut self.rng, &mut self.scalars);
        }
        outcome.ends_episode().then(|| {
            let decisions = (self.episode_actions.len() / self.action.len()) as u64;
            let finished = FinishedEpisode { total_reward: self.episode_reward, decisions };
            if self.recent_episodes.len() == RECENT_EPISODES {
                self.recent_episodes.pop_front();
            }
            self.recent_episodes.push_back(finished);
            self.begin_episode();
            finished
        })
    }

    /// Whether an evaluation is due at this step.
    #[must_use]
    pub fn evaluation_is_due(&self) -> bool {
        self.step > 0 && self.step.is_multiple_of(self.config.evaluate_every)
    }

    /// Deterministic episodes in `env` on seeds that training never uses; the same every time.
    pub fn evaluate(&mut self, env: &mut dyn Env) -> Evaluation {
        let seeds = (0..self.config.evaluation_episodes).map(|episode| SeedDomain::Evaluation.seed(episode));
        let episodes: Vec<_> =
            seeds.map(|seed| run_episode(&mut self.agent, env, seed, &mut self.compute)).collect();
        Evaluation {
            step: self.step,
            returns: episodes.iter().map(|episode| episode.total_reward).collect(),
            decisions: episodes.iter().map(|episode| episode.decisions).collect(),
        }
    }

    fn choose_action(&mut self) {
        if self.step < self.config.random_steps {
            self.action.fill_with(|| self.rng.random_range(-1.0..=1.0));
        } else {
            let Self { agent, compute, observation, memory, rng, action, .. } = self;
            agent.explore(compute, observation, memory, rng, action);
        }
    }

    fn begin_episode(&mut self) {
        self.episode_seed = SeedDomain::Training.seed(self.rng.random());
        self.episode_actions.clear();
        self.episode_reward = 0.0;
        self.memory.clear();
        self.env.reset(self.episode_seed, &mut self.observation);
        self.replay.begin_episode(&self.observation);
    }
}

/// One deterministic episode.
///
/// # Panics
///
/// When the environment refuses an action: the agent is of another environment.
pub fn run_episode(
    agent: &mut Agent,
    env: &mut dyn Env,
    seed: u64,
    compute: &mut Compute,
) -> FinishedEpisode {
    let mut memory = Memory::new(env.observation_len(), agent.config().history_len);
    let mut observation = vec![0.0; env.observation_len()];
    let mut next_observation = observation.clone();
    let mut action = vec![0.0; env.action_len()];
    let mut episode = FinishedEpisode { total_reward: 0.0, decisions: 0 };
    env.reset(seed, &mut observation);
    loop {
        agent.act(compute, &observation, &memory, &mut action);
        let outcome = env.step(&action, &mut next_observation);
        let outcome = outcome.unwrap_or_else(|error| panic!("an agent's action was refused: {error}"));
        episode.total_reward += outcome.reward;
        episode.decisions += 1;
        if outcome.ends_episode() {
            return episode;
        }
        memory.push(&observation);
        std::mem::swap(&mut observation, &mut next_observation);
    }
}
