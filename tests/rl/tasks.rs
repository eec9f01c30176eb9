//! Small tasks and the settings under which both algorithms learn them in seconds.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use searoom::env::{ActionError, Env, RewardTerm, Step};
use searoom::rl::agent::{AgentConfig, Algorithm};
use searoom::rl::sac::SacConfig;
use searoom::rl::td3::Td3Config;
use searoom::rl::trainer::TrainerConfig;

/// A cue of either sign is shown once; three decisions later the action has to repeat it. Nothing
/// that is seen in between tells it: without memory the best return is -1.
pub struct RecallCue {
    cue: f32,
    step: usize,
    terms: [RewardTerm; 1],
}

impl RecallCue {
    const DECISIONS: usize = 4;

    fn new() -> Self {
        Self { cue: 0.0, step: 0, terms: [RewardTerm { name: "miss", value: 0.0 }] }
    }

    fn observe(&self, observation: &mut [f32]) {
        observation[0] = if self.step == 0 { self.cue } else { 0.0 };
        observation[1] = if self.step + 1 == Self::DECISIONS { 1.0 } else { 0.0 };
    }
}

impl Env for RecallCue {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        1
    }

    fn max_decisions(&self) -> usize {
        Self::DECISIONS
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        self.cue = if ChaCha8Rng::seed_from_u64(seed).random() { 1.0 } else { -1.0 };
        self.step = 0;
        self.observe(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        self.step += 1;
        let asked = self.step == Self::DECISIONS;
        let miss = if asked { -f64::from(action[0] - self.cue).powi(2) } else { 0.0 };
        self.terms[0].value = miss;
        self.observe(observation);
        Ok(Step { reward: miss, terminated: asked, truncated: false })
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        &self.terms
    }
}

/// A point on a line is moved by the action and has to be kept at a mark that differs by episode.
pub struct Tracking {
    place: f64,
    mark: f64,
    step: usize,
    terms: [RewardTerm; 1],
}

impl Tracking {
    const DECISIONS: usize = 30;

    fn new() -> Self {
        Self { place: 0.0, mark: 0.0, step: 0, terms: [RewardTerm { name: "distance", value: 0.0 }] }
    }

    fn observe(&self, observation: &mut [f32]) {
        observation[0] = self.place as f32;
        observation[1] = self.mark as f32;
    }
}

impl Env for Tracking {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        1
    }

    fn max_decisions(&self) -> usize {
        Self::DECISIONS
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        self.place = rng.random_range(-1.0..1.0);
        self.mark = rng.random_range(-1.0..1.0);
        self.step = 0;
        self.observe(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        self.place += 0.2 * f64::from(action[0].clamp(-1.0, 1.0));
        self.step += 1;
        let distance = -(self.place - self.mark).abs();
        self.terms[0].value = distance;
        self.observe(observation);
        Ok(Step { reward: distance, terminated: false, truncated: self.step == Self::DECISIONS })
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        &self.terms
    }
}

/// Small networks and fast rates.
pub fn config(algorithm: Algorithm) -> TrainerConfig {
    let rate = 2e-3;
    TrainerConfig {
        seed: 3,
        replay_capacity: 20_000,
        random_steps: 500,
        evaluation_episodes: 20,
        agent: AgentConfig {
            algorithm,
            hidden: 32,
            td3: Td3Config {
                actor_learning_rate: rate,
                critic_learning_rate: rate,
                target_rate: 0.02,
                ..Td3Config::default()
            },
            sac: SacConfig {
                actor_learning_rate: rate,
                critic_learning_rate: rate,
                temperature_learning_rate: rate,
                target_rate: 0.02,
                ..SacConfig::default()
            },
            ..AgentConfig::default()
        },
        ..TrainerConfig::default()
    }
}

pub fn recall_cue() -> Box<dyn Env> {
    Box::new(RecallCue::new())
}

pub fn tracking() -> Box<dyn Env> {
    Box::new(Tracking::new())
}
