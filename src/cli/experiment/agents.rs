//! Trained agents for the figures that show them at work: those in run folders, or shipped ones in
//! `models/agents`.

use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;

use anyhow::{Context, bail};

use super::inputs::InputArgs;
use super::runs::folders_with;
use crate::agent::{POLICY, TrainedAgent};
use crate::cli::agent_run::{EnvMaker, TracksPart};
use crate::env::open_water::MotionKind;
use crate::env::{Env, EnvName};
use crate::experiment::curves::{AgentKind, Waters};
use crate::experiment::{Pilot, Product, Sailor, agents_in_episode};
use crate::rl::agent::{AgentConfig, Algorithm};

/// LSTM-SAC with estimates and without, as the paper shows them, in the same episode: of several seeds the one
/// that did best in the evaluations of its training.
pub(super) fn in_episode(waters: Waters, inputs: &InputArgs) -> anyhow::Result<Product> {
    let (motion, figure) = match waters {
        Waters::Stochastic => (MotionKind::Stochastic, "env_example_AR1"),
        Waters::Periodic => (MotionKind::Periodic, "env_example_sinus"),
        Waters::Coastal => bail!("this figure shows open water"),
    };
    let agents = agents(inputs)?;
    let mut sailors = Vec::new();
    for estimates in [true, false] {
        let kind = AgentKind { algorithm: Algorithm::LstmSac, estimates };
        let of_kind = agents.iter().filter(|agent| is(agent, kind, motion));
        let best = of_kind.max_by(|a, b| a.mean_return.total_cmp(&b.mean_return)).with_context(|| {
            format!(
                "{} has no {} trained in {}; train both agents with: searoom experiment run {figure} --from-scratch",
                folder(inputs).display(),
                kind.label(),
                waters.slug(),
            )
        })?;
        sailors.push(sailor(best, kind)?);
    }
    Ok(agents_in_episode(waters, &mut sailors, inputs.episode, inputs.seed())?)
}

fn is(agent: &TrainedAgent, kind: AgentKind, motion: MotionKind) -> bool {
    let config = &agent.config;
    config.env == EnvName::OpenWater
        && config.open_water.motion == motion
        && config.estimates == kind.estimates
        && config.trainer.agent.algorithm == kind.algorithm
        && config.trainer.agent.history_len == AgentConfig::default().history_len
}

fn sailor(agent: &TrainedAgent, kind: AgentKind) -> anyhow::Result<Sailor> {
    // Open water has no recorded tracks: either part makes the same environment.
    let env = EnvMaker::new(&agent.config, TracksPart::HeldOut)?.open_water()?;
    let pilot = Pilot::new(agent.agent.clone(), env.observation_len(), env.action_len());
    let (name, seed, step) = (agent.name.clone(), agent.config.trainer.seed, agent.step);
    Ok(Sailor { agent: kind, name, seed, step, env, pilot })
}

fn folder(inputs: &InputArgs) -> PathBuf {
    inputs.runs.clone().unwrap_or_else(|| inputs.models.join("agents"))
}

/// All agents there are.
fn agents(inputs: &InputArgs) -> anyhow::Result<Vec<TrainedAgent>> {
    let folder = folder(inputs);
    let paths = if inputs.runs.is_some() { folders_with(&folder, POLICY)? } else { files(&folder)? };
    Ok(paths.iter().map(|path| TrainedAgent::open(path)).collect::<Result<_, _>>()?)
}

/// The weights in a folder, by name; none where it is not there.
fn files(folder: &std::path::Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error).with_context(|| folder.display().to_string()),
    };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.extension().is_some_and(|extension| extension == "safetensors") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}
