//! Trained agents at the helm in open water.

use super::curves::AgentKind;
use super::field_record::FieldRecord;
use crate::env::ActionError;
use crate::env::open_water::OpenWater;
use crate::nn::Compute;
use crate::rl::agent::{Agent, Memory};

/// An agent with the memory of its episode; acts deterministically.
pub struct Pilot {
    agent: Agent,
    memory: Memory,
    compute: Compute,
    observation_len: usize,
    action: Vec<f32>,
}

impl Pilot {
    /// At the start of an episode.
    #[must_use]
    pub fn new(agent: Agent, observation_len: usize, action_len: usize) -> Self {
        let memory = Memory::new(observation_len, agent.config().history_len);
        Self { agent, memory, compute: Compute::new(1), observation_len, action: vec![0.0; action_len] }
    }

    /// Forgets the episode before.
    pub fn begin_episode(&mut self) {
        self.memory.clear();
    }

    /// The first component of the action that answers an observation.
    pub fn act(&mut self, observation: &[f32]) -> f32 {
        debug_assert_eq!(observation.len(), self.observation_len);
        self.agent.act(&mut self.compute, observation, &self.memory, &mut self.action);
        self.memory.push(observation);
        self.action[0]
    }
}

/// A trained agent in the environment that it was trained in.
pub struct Sailor {
    /// Which of the four agents.
    pub agent: AgentKind,
    /// Name of its run or file.
    pub name: String,
    /// Seed of its training.
    pub seed: u64,
    /// Step of training that its weights are from.
    pub step: u64,
    /// Its environment.
    pub env: OpenWater,
    /// The agent.
    pub pilot: Pilot,
}

impl Sailor {
    /// Sails the episode of `seed`.
    ///
    /// # Errors
    ///
    /// When the environment refuses an action.
    pub fn sail(&mut self, seed: u64) -> Result<FieldRecord, ActionError> {
        let Self { env, pilot, .. } = self;
        pilot.begin_episode();
        let dt_s = env.config().dt_s;
        FieldRecord::sail(env, dt_s, seed, |_, observation| pilot.act(observation))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::env::Env;
    use crate::env::open_water::OpenWaterConfig;
    use crate::forecast::LinearForecaster;
    use crate::rl::agent::AgentConfig;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// A small network with random weights in short episodes.
    pub(in crate::experiment) fn untrained(agent: AgentKind) -> Sailor {
        let config = OpenWaterConfig { decisions: 60, ..OpenWaterConfig::default() };
        let forecaster = agent.estimates.then(|| Box::new(LinearForecaster::over(10)) as _);
        let env = OpenWater::new(config, forecaster).unwrap();
        let settings = AgentConfig { algorithm: agent.algorithm, hidden: 8, ..AgentConfig::default() };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let learner = Agent::new(settings, env.observation_len(), env.action_len(), &mut rng);
        let pilot = Pilot::new(learner, env.observation_len(), env.action_len());
        Sailor { agent, name: "untrained".into(), seed: 7, step: 1200, env, pilot }
    }
}
