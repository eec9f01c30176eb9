//! Policies by what a command line calls them: a name, a run's folder or an agent's file.

use std::path::Path;

use anyhow::bail;

use super::agent_run::load_forecaster;
use crate::agent::TrainedAgent;
use crate::forecast::{Forecaster, LstmForecaster};
use crate::geo::Geodetic;
use crate::policy::{self, Policy, TrainedPolicy};

/// What a policy steers in, as far as a trained agent has to know.
pub(super) struct Waters {
    /// Time between two decisions, in seconds.
    pub decision_s: f64,
    /// Origin of the local plane, where there is one.
    pub origin: Option<Geodetic>,
}

/// The policy, and a remark on how it is used where there is one to make.
pub(super) fn open(name: &str, waters: &Waters) -> anyhow::Result<(Box<dyn Policy>, Option<String>)> {
    if let Some(policy) = policy::by_name(name) {
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
