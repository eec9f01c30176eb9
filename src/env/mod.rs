//! Environments in which an agent learns: the Gymnasium contract over encounters of this crate.
//!
//! `reset(seed)` starts an episode, `step(action)` makes one decision. Observations are f32 slices
//! that the caller owns; everything before them is f64. A time limit *truncates* an episode, it never
//! *terminates* it: an agent bootstraps through it unless it is told not to. Equal seeds and equal
//! actions give equal bits, so an episode under way can be restored from its seed and the actions taken
//! since.

use thiserror::Error;

pub mod coastal;
pub mod open_water;
pub mod registry;

pub use registry::EnvName;

/// What one decision brought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Sum of the reward terms; [`Env::reward_terms`] gives them one by one.
    pub reward: f64,
    /// The task ended; nothing follows that could be valued.
    pub terminated: bool,
    /// The time limit was reached; the task itself goes on.
    pub truncated: bool,
}

impl Step {
    /// Whether the episode is over and [`Env::reset`] has to come next.
    #[must_use]
    pub fn ends_episode(&self) -> bool {
        self.terminated || self.truncated
    }
}

/// One named part of the reward of the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RewardTerm {
    /// What is rewarded, such as `wrong_passings`.
    pub name: &'static str,
    /// Its share of the reward.
    pub value: f64,
}

/// Why an action was refused; the environment is left as it was.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ActionError {
    /// The action has the wrong number of components.
    #[error("the action has {given} component(s), this environment takes {expected}")]
    Length {
        /// Components given.
        given: usize,
        /// Components expected.
        expected: usize,
    },
    /// A component is not a number.
    #[error("component {index} of the action is {value}; every component must be a finite number")]
    NotFinite {
        /// Index of the component.
        index: usize,
        /// Its value.
        value: f32,
    },
    /// The episode is over.
    #[error("the episode is over; reset the environment before the next step")]
    EpisodeOver,
}

/// An environment. Actions are components in `[-1, 1]`; values beyond are clipped.
pub trait Env: Send {
    /// Length of an observation.
    fn observation_len(&self) -> usize;

    /// Number of components of an action.
    fn action_len(&self) -> usize;

    /// Decisions after which an episode is truncated.
    fn max_decisions(&self) -> usize;

    /// Starts an episode and writes its first observation.
    fn reset(&mut self, seed: u64, observation: &mut [f32]);

    /// Makes one decision and writes the observation that follows.
    ///
    /// # Errors
    ///
    /// When the action has the wrong length, holds a value that is not finite, or the episode is over.
    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError>;

    /// The terms that the reward of the last step is the sum of.
    fn reward_terms(&self) -> &[RewardTerm];
}

impl<E: Env + ?Sized> Env for Box<E> {
    fn observation_len(&self) -> usize {
        (**self).observation_len()
    }

    fn action_len(&self) -> usize {
        (**self).action_len()
    }

    fn max_decisions(&self) -> usize {
        (**self).max_decisions()
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        (**self).reset(seed, observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        (**self).step(action, observation)
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        (**self).reward_terms()
    }
}

/// What an episode's seed is for. Seeds of different domains never coincide, so that an agent is
/// never tested on an episode it was trained on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeedDomain {
    /// Episodes that agents learn from.
    Training,
    /// Episodes on which an agent is judged while it trains.
    Evaluation,
    /// Episodes of benchmarks and experiments.
    Benchmark,
}

impl SeedDomain {
    /// The seed number `index` of this domain; the upper two bits of `index` are not used.
    #[must_use]
    pub fn seed(self, index: u64) -> u64 {
        let domain = match self {
            Self::Training => 0,
            Self::Evaluation => 1,
            Self::Benchmark => 2,
        };
        (index & (u64::MAX >> 2)) | (domain << 62)
    }
}

/// Refuses an action that no environment could take.
fn check_action(action: &[f32], expected: usize) -> Result<(), ActionError> {
    if action.len() != expected {
        return Err(ActionError::Length { given: action.len(), expected });
    }
    match action.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(ActionError::NotFinite { index, value: action[index] }),
        None => Ok(()),
    }
}
