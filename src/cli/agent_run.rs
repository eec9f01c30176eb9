//! The folder of a training run: its configuration, environment, weights and logs.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

use crate::config;
use crate::env::Env;
use crate::env::open_water::{MotionKind, OpenWater, OpenWaterConfig};
use crate::forecast::{Forecaster, LstmForecaster, Model};
use crate::nn::weights::WeightsFile;
use crate::rl::agent::Agent;
use crate::rl::trainer::TrainerConfig;

/// Name of the resolved configuration in a run's folder.
pub const CONFIG: &str = "config.toml";
/// Name of the weights of the best policy in a run's folder.
pub const POLICY: &str = "policy.safetensors";

/// The environments that agents can be trained in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum EnvName {
    /// Open water with passing rules (the paper's training environment).
    #[default]
    OpenWater,
}

/// Everything that a run depends on. Every key has a default: the paper's value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunConfig {
    /// The environment.
    pub env: EnvName,
    /// Decisions to train on.
    pub steps: u64,
    /// Whether the observation holds estimates of the collision risk.
    pub estimates: bool,
    /// Weights of the forecaster behind the estimates; without it, the shipped one for the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forecaster: Option<PathBuf>,
    /// Constants of the open-water environment.
    pub open_water: OpenWaterConfig,
    /// Training and agent.
    pub trainer: TrainerConfig,
}

impl Default for RunConfig {
    fn default() -> Self {
        Self {
            env: EnvName::default(),
            steps: 1_500_000,
            estimates: true,
            forecaster: None,
            open_water: OpenWaterConfig::default(),
            trainer: TrainerConfig::default(),
        }
    }
}

impl RunConfig {
    /// Reads the configuration of the run in `folder`.
    pub fn of_run(folder: &Path) -> anyhow::Result<Self> {
        let file = folder.join(CONFIG);
        if !file.exists() {
            bail!(
                "{} is no run: it has no {CONFIG}; give the folder that `searoom train` wrote",
                folder.display()
            );
        }
        Ok(config::load(&file)?)
    }

    /// The forecaster's weights.
    fn forecaster_file(&self) -> PathBuf {
        self.forecaster.clone().unwrap_or_else(|| {
            let motion = match self.open_water.motion {
                MotionKind::Stochastic => "stochastic",
                MotionKind::Periodic => "periodic",
            };
            PathBuf::from(format!("models/open-water-{motion}.safetensors"))
        })
    }

    /// Makes the environment, with its forecaster on one thread.
    pub fn make_env(&self) -> anyhow::Result<Box<dyn Env>> {
        let forecaster = self.estimates.then(|| self.load_forecaster()).transpose()?;
        match self.env {
            EnvName::OpenWater => {
                let env =
                    OpenWater::new(self.open_water.clone(), forecaster).context("key \"open_water\"")?;
                Ok(Box::new(env))
            }
        }
    }

    fn load_forecaster(&self) -> anyhow::Result<Box<dyn Forecaster>> {
        let file = self.forecaster_file();
        let model = WeightsFile::open(&file)
            .map_err(anyhow::Error::from)
            .and_then(|file| Ok(Model::from_file(file)?));
        let model = model.with_context(|| {
            format!(
                "{}: no forecaster for the estimates; name one with `forecaster`, or train without estimates \
                 (--no-estimates)",
                file.display()
            )
        })?;
        Ok(Box::new(LstmForecaster::new(model, 1)))
    }
}

/// Fills the actor of `agent` from the weights of a policy.
pub fn load_policy(file: &Path, agent: &mut Agent) -> anyhow::Result<()> {
    let weights = WeightsFile::open(file)?;
    let [actor, ..] = agent.networks();
    weights.read_parameters("", actor.online)?;
    Ok(weights.finish()?)
}
