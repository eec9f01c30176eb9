//! A trained agent on disk: the weights of its policy and the configuration they belong to, in one file.
//!
//! The file is a safetensors file. Its metadata hold the whole configuration of the run as JSON (`config`), the
//! decisions trained on before these weights (`step`) and their mean return in the evaluation that chose them
//! (`mean_return`). Nothing else is needed to act with the agent, except the forecaster that the configuration
//! names.

use std::path::{Path, PathBuf};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use super::RunConfig;
use crate::config::ConfigError;
use crate::nn::weights::{WeightsError, WeightsFile, WeightsWriter};
use crate::rl::agent::Agent;
use crate::rl::checkpoint::policy_weights;

/// Name of the resolved configuration in a run's folder.
pub const CONFIG: &str = "config.toml";
/// Name of the weights of the best policy in a run's folder.
pub const POLICY: &str = "policy.safetensors";

/// Components of an action, in every environment.
const ACTION_LEN: usize = 1;

/// A policy and what it was trained in.
#[derive(Debug, Clone)]
pub struct TrainedAgent {
    /// Name of its run, or of its file without the extension.
    pub name: String,
    /// The configuration of its run.
    pub config: RunConfig,
    /// Decisions trained on before these weights.
    pub step: u64,
    /// Mean return in the evaluation that chose them.
    pub mean_return: f64,
    /// The agent; only its policy was learned.
    pub agent: Agent,
}

/// Why there is no trained agent.
#[derive(Debug, Error)]
pub enum TrainedAgentError {
    /// The folder is not that of a run.
    #[error("{} is no run: it has no {CONFIG}; give the folder that `searoom train` wrote", folder.display())]
    NoRun {
        /// The folder.
        folder: PathBuf,
    },
    /// The run has not been evaluated yet.
    #[error(
        "{} has no policy yet: the first is kept at the first evaluation; train on (searoom train --resume {})",
        folder.display(), folder.display()
    )]
    NoPolicy {
        /// The folder.
        folder: PathBuf,
    },
    /// The run's configuration cannot be read.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The weights cannot be read, or are those of another network.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The file does not say what its weights belong to.
    #[error(
        "{}: does not say which agent its weights are of; give the folder of its run, or write it again with \
         `searoom export`", path.display()
    )]
    NotDescribed {
        /// The file.
        path: PathBuf,
    },
    /// What the file says of its agent is not understood.
    #[error(
        "{}: what it says of itself describes no agent of this version of searoom ({reason}); is it a forecaster?",
        path.display()
    )]
    Description {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

impl TrainedAgent {
    /// Reads a run's folder, or the one file of an agent.
    ///
    /// # Errors
    ///
    /// When there is no such agent, or its parts do not fit together.
    pub fn open(path: &Path) -> Result<Self, TrainedAgentError> {
        if !path.is_dir() && path.exists() {
            let file = WeightsFile::open(path)?;
            let config = described(&file)?;
            return Self::read(path, config, file);
        }
        let config = run_config(path)?;
        let policy = path.join(POLICY);
        if !policy.exists() {
            return Err(TrainedAgentError::NoPolicy { folder: path.to_owned() });
        }
        Self::read(path, config, WeightsFile::open(&policy)?)
    }

    fn read(path: &Path, config: RunConfig, file: WeightsFile) -> Result<Self, TrainedAgentError> {
        // The weights are read: what they are initialised with does not matter.
        let rng = &mut ChaCha8Rng::seed_from_u64(0);
        let mut agent = Agent::new(config.trainer.agent.clone(), config.observation_len(), ACTION_LEN, rng);
        let [actor, ..] = agent.networks();
        file.read_parameters("", actor.online)?;
        let (step, mean_return) = (file.fact("step")?, file.fact("mean_return")?);
        file.finish()?;
        let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
        let name =
            name.map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, config, step, mean_return, agent })
    }

    /// The file of the policy of `agent` as it is now.
    #[must_use]
    pub fn file(config: &RunConfig, agent: &mut Agent, step: u64, mean_return: f64) -> WeightsWriter {
        let config = serde_json::to_string(config).expect("plain data with string keys");
        policy_weights(agent).fact("config", config).fact("step", step).fact("mean_return", mean_return)
    }

    /// Its file.
    #[must_use]
    pub fn to_file(&mut self) -> WeightsWriter {
        Self::file(&self.config, &mut self.agent, self.step, self.mean_return)
    }
}

/// The configuration of the run in a folder.
///
/// # Errors
///
/// When the folder has none, or one that cannot be read.
pub fn run_config(folder: &Path) -> Result<RunConfig, TrainedAgentError> {
    let file = folder.join(CONFIG);
    if !file.exists() {
        return Err(TrainedAgentError::NoRun { folder: folder.to_owned() });
    }
    Ok(RunConfig::load(&file, None)?)
}

/// The configuration that a file carries.
fn described(file: &WeightsFile) -> Result<RunConfig, TrainedAgentError> {
    let path = file.path().to_owned();
    let text: String = match file.fact("config") {
        Ok(text) => text,
        Err(_) => return Err(TrainedAgentError::NotDescribed { path }),
    };
    let refused = |reason| TrainedAgentError::Description { path: path.clone(), reason };
    let config: RunConfig = serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
    config.check().map_err(|fault| refused(fault.to_string()))?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::EnvName;

    fn trained(env: EnvName) -> TrainedAgent {
        let mut config = RunConfig::of(env);
        config.estimates = false;
        config.trainer.agent.hidden = 8;
        let rng = &mut ChaCha8Rng::seed_from_u64(4);
        let agent = Agent::new(config.trainer.agent.clone(), config.observation_len(), 1, rng);
        TrainedAgent { name: "some".into(), config, step: 40, mean_return: -1.25, agent }
    }

    fn weights(agent: &mut TrainedAgent) -> Vec<f32> {
        agent.agent.networks()[0].online.values().to_vec()
    }

    #[test]
    fn one_file_is_the_whole_agent() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.safetensors");
        for env in [EnvName::OpenWater, EnvName::Coastal] {
            let mut saved = trained(env);
            saved.to_file().save(&path).unwrap();
            let mut loaded = TrainedAgent::open(&path).unwrap();
            assert_eq!((&loaded.config, loaded.step, loaded.mean_return), (&saved.config, 40, -1.25));
            assert_eq!(loaded.name, "some");
            assert_eq!(weights(&mut saved), weights(&mut loaded));
        }
    }

    #[test]
    fn weights_that_do_not_say_whose_they_are_are_refused_with_a_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(POLICY);
        let mut agent = trained(EnvName::OpenWater);
        policy_weights(&mut agent.agent).fact("step", 1).fact("mean_return", 0).save(&path).unwrap();
        let error = TrainedAgent::open(&path).unwrap_err().to_string();
        assert!(error.contains("give the folder of its run"), "{error}");

        // Beside the configuration of the run they say enough.
        let error = TrainedAgent::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("is no run"), "{error}");
        std::fs::write(folder.path().join(CONFIG), toml::to_string(&agent.config).unwrap()).unwrap();
        assert_eq!(TrainedAgent::open(folder.path()).unwrap().config, agent.config);
    }

    #[test]
    fn weights_of_another_configuration_are_refused_by_shape() {
        let folder = tempfile::tempdir().unwrap();
        let mut agent = trained(EnvName::OpenWater);
        agent.to_file().save(&folder.path().join(POLICY)).unwrap();
        agent.config.estimates = true;
        std::fs::write(folder.path().join(CONFIG), toml::to_string(&agent.config).unwrap()).unwrap();
        let error = TrainedAgent::open(folder.path()).unwrap_err();
        assert!(matches!(error, TrainedAgentError::Weights(WeightsError::Shape { .. })), "{error}");
    }

    #[test]
    fn a_run_without_a_policy_and_a_description_of_the_future_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let mut agent = trained(EnvName::Coastal);
        std::fs::write(folder.path().join(CONFIG), toml::to_string(&agent.config).unwrap()).unwrap();
        let error = TrainedAgent::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("no policy yet"), "{error}");
        let path = folder.path().join("new.safetensors");
        agent.to_file().fact("config", "{\"anchor\": 1}").save(&path).unwrap();
        let error = TrainedAgent::open(&path).unwrap_err().to_string();
        assert!(error.contains("anchor") && error.contains("describes no agent"), "{error}");
    }
}
