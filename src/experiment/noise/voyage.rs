//! One episode under one contestant.

use serde::{Deserialize, Serialize};

use super::{Group, Helm, NoiseConfig, NoiseError};
use crate::encounter::RulesConfig;
use crate::env::coastal::Coastal;
use crate::env::{ActionError, Env};
use crate::episode::Episode;

/// What came of an episode, and the actions that it can be sailed again by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Voyage {
    /// Seed of the episode.
    pub seed: u64,
    /// MMSI of the recorded vessel.
    pub mmsi: u32,
    /// Whether collision circles touched at any time.
    pub contact: bool,
    /// Whether they touched at the time of a decision.
    pub contact_at_decision: bool,
    /// Whether the cross-track error to port reached its limit at the time of a decision.
    pub wrong_side: bool,
    /// Closest distance of centres at any time, in metres.
    pub closest_m: f64,
    /// Sum of rewards.
    pub total_reward: f64,
    /// Estimates that rest on a straight line in place of a forecast.
    pub fallbacks: u64,
    /// Mean score of its encounters under the collision regulations, 0 to 1; nothing without one.
    pub compliance: Option<f64>,
    /// The action of every decision.
    pub actions: Vec<f32>,
}

impl Voyage {
    /// Sails the episode of `seed` in an environment that keeps its steps.
    ///
    /// # Errors
    ///
    /// When the environment refuses an action.
    pub(super) fn sail(
        env: &mut Coastal,
        helm: &mut dyn Helm,
        seed: u64,
        rules: &RulesConfig,
    ) -> Result<Self, ActionError> {
        helm.begin(seed);
        let fallbacks_before = env.fallbacks();
        let (mut total_reward, mut actions) = (0.0, Vec::with_capacity(env.max_decisions()));
        let mut observation = vec![0.0; env.observation_len()];
        env.reset(seed, &mut observation);
        loop {
            let action = helm.action(env, &observation);
            let step = env.step(&[action], &mut observation)?;
            actions.push(action);
            total_reward += step.reward;
            if step.ends_episode() {
                break;
            }
        }
        let (outcome, opening) = env.outcome().zip(env.opening()).ok_or(ActionError::EpisodeOver)?;
        let compliance =
            env.record("").and_then(|episode| episode.compliance(&rules.encounters, &rules.compliance).score);
        Ok(Self {
            seed,
            mmsi: opening.start.mmsi,
            contact: outcome.contact,
            contact_at_decision: outcome.contact_at_decision,
            wrong_side: outcome.wrong_side,
            closest_m: outcome.closest_m,
            total_reward,
            fallbacks: env.fallbacks() - fallbacks_before,
            compliance,
            actions,
        })
    }
}

/// The episodes of voyages, sailed again for every time step.
///
/// # Errors
///
/// When there is no environment, or it refuses an action: the voyages were made in another.
pub fn record(
    group: &Group<'_>,
    config: &NoiseConfig,
    policy: &str,
    voyages: &[Voyage],
) -> Result<Vec<Episode>, NoiseError> {
    let mut env = group.env(config, None)?;
    env.keep_steps();
    let mut observation = vec![0.0; env.observation_len()];
    let mut sail = |voyage: &Voyage| {
        env.reset(voyage.seed, &mut observation);
        voyage.actions.iter().try_for_each(|&action| env.step(&[action], &mut observation).map(|_| ()))?;
        env.record(policy).ok_or(ActionError::EpisodeOver)
    };
    let episodes = voyages.iter().enumerate().map(|(episode, voyage)| {
        sail(voyage).map_err(|source| NoiseError::Action { policy: policy.to_owned(), episode, source })
    });
    episodes.collect()
}
