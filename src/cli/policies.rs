//! Policies by what a command line calls them: a name, a run's folder or an agent's file.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::agent_run::load_forecaster;
use crate::agent::TrainedAgent;
use crate::config;
use crate::encounter::RulesConfig;
use crate::forecast::{Forecaster, LstmForecaster};
use crate::geo::Geodetic;
use crate::policy::{self, Policy, PolicyConfigs, TrainedPolicy};

/// Options of every command that runs policies.
#[derive(Debug, clap::Args)]
pub(super) struct PolicyArgs {
    /// TOML file with settings of policies: one table per policy, named like it; docs/encounters.md tells more
    #[arg(long, value_name = "FILE")]
    policy_config: Option<PathBuf>,
}

impl PolicyArgs {
    /// The settings; the defaults where no file is named.
    pub fn load(&self) -> anyhow::Result<PolicyConfigs> {
        let Some(file) = &self.policy_config else { return Ok(PolicyConfigs::default()) };
        Ok(config::load_checked(file, PolicyConfigs::check)?)
    }
}

/// Options of every benchmark that scores compliance with the collision regulations.
#[derive(Debug, clap::Args)]
pub(super) struct RulesArgs {
    /// TOML file with the tables [encounters] and [compliance]: when an encounter begins, what counts as good conduct;
    /// docs/encounters.md has the keys
    #[arg(long, value_name = "FILE")]
    rules_config: Option<PathBuf>,
}

impl RulesArgs {
    /// The thresholds; the defaults where no file is named.
    pub fn load(&self) -> anyhow::Result<RulesConfig> {
        let Some(file) = &self.rules_config else { return Ok(RulesConfig::default()) };
        Ok(config::load_checked(file, |rules: &RulesConfig| rules.check())?)
    }
}

/// What a policy steers in, as far as a trained agent has to know.
pub(super) struct Waters {
    /// Time between two decisions, in seconds.
    pub decision_s: f64,
    /// Origin of the local plane, where there is one.
    pub origin: Option<Geodetic>,
}

/// The policy, and a remark on how it is used where there is one to make.
pub(super) fn open(
    name: &str,
    waters: &Waters,
    configs: &PolicyConfigs,
) -> anyhow::Result<(Box<dyn Policy>, Option<String>)> {
    if let Some(policy) = configs.policy(name) {
        return Ok((policy, None));
    }
    let path = Path::new(name);
    if !path.exists() {
        bail!(
            "\"{name}\" is no policy: write one of {}, the folder of a run (runs/...) or the file of an agent \
             (models/agents/....safetensors)",
            policy::NAMES.join(", ")
        );
    }
    let agent = TrainedAgent::open(path)?;
    let mut remark = None;
    let mut forecaster: Option<Box<dyn Forecaster>> = None;
    if agent.config.estimates && agent.config.env == crate::env::EnvName::Coastal {
        let model = load_forecaster(&agent.config)?;
        // A forecaster knows where it is: in another plane its anchor means another place.
        if model.origin == waters.origin {
            forecaster = Some(Box::new(LstmForecaster::new(model, 1)));
        } else {
            remark = Some(format!(
                "the forecaster \"{}\" was trained in another area; {} estimates that all target ships hold course \
                 and speed",
                model.config.name, agent.name
            ));
        }
    }
    let policy = TrainedPolicy::new(agent, forecaster)?;
    policy.check_pace(waters.decision_s)?;
    Ok((Box::new(policy), remark))
}
