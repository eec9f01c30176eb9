//! Who takes part: agents from files and run folders, classical policies by name.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use anyhow::bail;

use super::forecasters::Forecasters;
use super::recordings::Recordings;
use super::{Args, ledger};
use crate::agent::{POLICY, TrainedAgent};
use crate::config::did_you_mean;
use crate::env::EnvName;
use crate::env::coastal::{Coastal, CoastalConfig};
use crate::experiment::noise::{Contestant, Estimates, Helm};
use crate::forecast::Model;
use crate::nn::Compute;
use crate::policy::{self, HoldCourse, Policy};
use crate::rl::agent::Algorithm;
use crate::rl::rollout::{AgentBatch, BatchPolicy};

/// Where agents are shipped.
const SHIPPED: &str = "models/agents";
/// Classical policies that take part only where they are named.
const LEFT_OUT: [&str; 1] = ["full-port"];
/// Classical policies that a forecast makes a difference to.
const USE_FORECASTS: [&str; 3] = ["velocity-obstacle", "potential-field", "mpc"];

/// All who take part, and the forecasters they need.
pub(super) struct Field {
    pub contestants: Vec<Contestant>,
    pub forecasters: Forecasters,
    agents: Vec<TrainedAgent>,
    /// What the actions of each contestant follow from beside the program: its files.
    fingerprints: HashMap<String, u64>,
}

/// An agent at the helm: the deterministic policy on the environment's own observation.
struct AgentHelm(AgentBatch);

impl Helm for AgentHelm {
    fn begin(&mut self, seed: u64) {
        self.0.begin(0, seed);
    }

    fn action(&mut self, _env: &Coastal, observation: &[f32]) -> f32 {
        let mut action = [0.0];
        self.0.act(observation, &mut action);
        action[0]
    }
}

impl Field {
    pub(super) fn load(args: &Args, coastal: &CoastalConfig) -> anyhow::Result<Self> {
        let mut field = Self {
            contestants: Vec::new(),
            forecasters: Forecasters::new(),
            agents: Vec::new(),
            fingerprints: HashMap::new(),
        };
        if args.policies.is_empty() {
            for (path, agent) in shipped_agents(args.all_seeds)? {
                field.add_agent(&path, agent, coastal)?;
            }
            for name in policy::NAMES.into_iter().filter(|name| !LEFT_OUT.contains(name)) {
                field.add_classical(name, args, coastal)?;
            }
        }
        for path in &args.policies {
            match path.to_str().filter(|name| policy::by_name(name).is_some()) {
                Some(name) => field.add_classical(name, args, coastal)?,
                None => field.add_agent(path, open_agent(path)?, coastal)?,
            }
        }
        Ok(field)
    }

    /// What a contestant's actions follow from beside the program.
    pub(super) fn fingerprint(&self, contestant: &Contestant) -> u64 {
        self.fingerprints.get(&contestant.name).copied().unwrap_or_default()
    }

    fn add(&mut self, contestant: Contestant, fingerprint: u64) -> anyhow::Result<()> {
        if self.contestants.iter().any(|other| other.name == contestant.name) {
            bail!(
                "--policies has two called \"{}\": give each file or folder a name of its own",
                contestant.name
            );
        }
        self.fingerprints.insert(contestant.name.clone(), fingerprint);
        self.contestants.push(contestant);
        Ok(())
    }

    fn add_agent(&mut self, path: &Path, agent: TrainedAgent, coastal: &CoastalConfig) -> anyhow::Result<()> {
        if agent.config.env != EnvName::Coastal {
            bail!(
                "{}: this agent was trained in open water; the benchmark is sailed in coastal waters",
                path.display()
            );
        }
        let estimates = if agent.config.estimates {
            Estimates::Forecast(self.forecasters.number(&agent.config.forecaster_file())?)
        } else {
            Estimates::None
        };
        let sailor = agent.agent.clone();
        let make =
            move || -> Box<dyn Helm> { Box::new(AgentHelm(AgentBatch::new(&sailor, 1, Compute::new(1)))) };
        let learner = (agent.config.trainer.agent.algorithm, estimates);
        let contestant = Contestant::agent(&agent.name, learner, (&agent.config.coastal, coastal), make)?;
        let with_true_future = contestant.with_true_future();
        let weights = if path.is_dir() { path.join(POLICY) } else { path.to_owned() };
        let fingerprint = ledger::fingerprint(&weights, &serde_json::to_string(&agent.config)?)?;
        self.add(contestant, fingerprint)?;
        with_true_future.map_or(Ok(()), |contestant| self.add(contestant, fingerprint))?;
        self.agents.push(agent);
        Ok(())
    }

    /// A classical policy; one that can use forecasts takes part without and with them.
    fn add_classical(&mut self, name: &str, args: &Args, coastal: &CoastalConfig) -> anyhow::Result<()> {
        let Some(name) = policy::NAMES.into_iter().find(|known| *known == name) else { return Ok(()) };
        // The name is one of those that there are policies of.
        let make =
            move || -> Box<dyn Policy> { policy::by_name(name).unwrap_or_else(|| Box::new(HoldCourse)) };
        self.add(Contestant::classical(name, Estimates::None, coastal, make), 0)?;
        if USE_FORECASTS.contains(&name) {
            let estimates = Estimates::Forecast(self.forecasters.number(&args.forecaster)?);
            self.add(Contestant::classical(format!("{name} + forecast"), estimates, coastal, make), 0)?;
        }
        Ok(())
    }

    /// What everyone should know who reads the results.
    pub(super) fn warnings(&self, recordings: &Recordings) -> Vec<String> {
        let mut warnings = Vec::new();
        let elsewhere =
            |model: &&(PathBuf, Model)| model.1.origin.is_some_and(|origin| origin != recordings.origin);
        for (_, model) in self.forecasters.iter().filter(elsewhere) {
            warnings.push(format!(
                "the forecaster \"{}\" was trained in another area than {}: its forecasts mean little here",
                model.config.name, recordings.area
            ));
        }
        for agent in &self.agents {
            if recordings.trained_on.as_ref() != Some(&agent.config.tracks) {
                warnings.push(format!(
                    "{} was trained on {}, not on the training part of the tracks sailed here",
                    agent.name,
                    agent.config.tracks.area.display()
                ));
            }
        }
        warnings
    }
}

/// The shipped agents of coastal waters, by name: of each kind the one whose evaluation in training was best, or every
/// seed.
fn shipped_agents(all_seeds: bool) -> anyhow::Result<Vec<(PathBuf, TrainedAgent)>> {
    let Ok(entries) = fs::read_dir(SHIPPED) else {
        eprintln!("note: no agents in {SHIPPED} (run from the project's root); classical policies only");
        return Ok(Vec::new());
    };
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<PathBuf>>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "safetensors"));
    paths.sort();
    let mut agents: Vec<(PathBuf, TrainedAgent)> = Vec::new();
    for path in paths {
        let agent = TrainedAgent::open(&path)?;
        if agent.config.env != EnvName::Coastal {
            continue;
        }
        let alike = |other: &TrainedAgent| kind_of(other) == kind_of(&agent);
        match agents.iter_mut().find(|(_, other)| !all_seeds && alike(other)) {
            Some(best) if agent.mean_return > best.1.mean_return => *best = (path, agent),
            Some(_) => {}
            None => agents.push((path, agent)),
        }
    }
    Ok(agents)
}

/// What agents have in common that differ in their seed only.
fn kind_of(agent: &TrainedAgent) -> (Algorithm, bool, usize) {
    let learner = &agent.config.trainer.agent;
    (learner.algorithm, agent.config.estimates, learner.history_len)
}

fn open_agent(path: &Path) -> anyhow::Result<TrainedAgent> {
    if !path.exists() {
        let name = path.display();
        bail!(
            "--policies: \"{name}\" is neither a file nor a folder nor a policy's name: {}",
            did_you_mean(&name.to_string(), policy::NAMES)
        );
    }
    Ok(TrainedAgent::open(path)?)
}
