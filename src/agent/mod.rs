//! Agents and what they were trained in: the configuration of a run, and its policy in one file.

mod bounds;
mod config;
mod trained;

pub use config::{RunConfig, TracksConfig};
pub use trained::{CONFIG, POLICY, TrainedAgent, TrainedAgentError, run_config};
