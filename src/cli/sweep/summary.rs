//! What a sweep brought: one CSV line per run, one table row per agent over its seeds.

use std::path::Path;

use anyhow::Context;
use serde::Serialize;

use super::plan::{PlannedRun, word};
use crate::atomic_file;
use crate::cli::agent_training::{EvaluationPoint, evaluations_of};
use crate::cli::table::table;
use crate::env::EnvName;
use crate::experiment::statistics::{CONFIDENCE, Estimate, mean};

/// One run by its evaluations so far.
#[derive(Debug, Serialize)]
pub(super) struct RunSummary {
    pub name: String,
    pub agent: String,
    env: EnvName,
    /// Motion of the obstacles, in open water.
    motion: Option<String>,
    algorithm: String,
    estimates: bool,
    history_len: usize,
    /// Values on the further axes of the grid.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    grid: Vec<String>,
    seed: u64,
    /// Decisions that the run is to make.
    steps: u64,
    evaluations: usize,
    best: Option<EvaluationPoint>,
    last: Option<EvaluationPoint>,
}

impl RunSummary {
    /// Reads the evaluations of a run up to its end.
    pub fn of(run: &PlannedRun) -> anyhow::Result<Self> {
        let mut points = evaluations_of(&run.folder)?;
        // A run that was trained on beyond this sweep counts as far as the sweep goes.
        points.retain(|point| point.step <= run.config.steps);
        let best = points
            .iter()
            .copied()
            .reduce(|best, point| if point.mean_return > best.mean_return { point } else { best });
        let is_open_water = run.config.env == EnvName::OpenWater;
        Ok(Self {
            name: run.name(),
            agent: run.agent.clone(),
            env: run.config.env,
            motion: is_open_water.then(|| word(run.config.open_water.motion)),
            algorithm: word(run.config.trainer.agent.algorithm),
            estimates: run.config.estimates,
            history_len: run.config.trainer.agent.history_len,
            grid: run.grid.clone(),
            seed: run.config.trainer.seed,
            steps: run.config.steps,
            evaluations: points.len(),
            best,
            last: points.last().copied(),
        })
    }
}

/// Writes one line per run, in the order of the grid.
pub(super) fn write_csv<'a>(
    path: &Path,
    grid_keys: impl Iterator<Item = &'a str>,
    runs: &[RunSummary],
) -> anyhow::Result<()> {
    let mut header = vec!["run", "agent", "env", "motion", "algorithm", "estimates", "history_len"];
    header.extend(grid_keys);
    header.extend([
        "seed",
        "steps",
        "evaluations",
        "best_step",
        "best_mean_return",
        "last_step",
        "last_mean_return",
    ]);
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(&header)?;
    for run in runs {
        let mut cells = vec![
            run.name.clone(),
            run.agent.clone(),
            word(run.env),
            run.motion.clone().unwrap_or_default(),
            run.algorithm.clone(),
            run.estimates.to_string(),
            run.history_len.to_string(),
        ];
        cells.extend(run.grid.iter().cloned());
        cells.extend([run.seed.to_string(), run.steps.to_string(), run.evaluations.to_string()]);
        for point in [run.best, run.last] {
            cells.push(point.map_or_else(String::new, |point| point.step.to_string()));
            cells.push(point.map_or_else(String::new, |point| point.mean_return.to_string()));
        }
        csv.write_record(&cells)?;
    }
    let bytes = csv.into_inner().context("the summary cannot be put together")?;
    Ok(atomic_file::write(path, |file| file.write_all(&bytes))?)
}

/// An agent over its seeds.
#[derive(Debug, Serialize)]
pub(super) struct AgentSummary {
    agent: String,
    seeds: usize,
    /// Mean over seeds of the best evaluation, with Student's interval.
    best: Option<Estimate>,
    /// The same of the last evaluation.
    last: Option<Estimate>,
}

/// Groups runs by agent, in the order of the grid.
pub(super) fn by_agent(runs: &[RunSummary]) -> Vec<AgentSummary> {
    runs.chunk_by(|a, b| a.agent == b.agent)
        .map(|runs| {
            let over_seeds = |point: fn(&RunSummary) -> Option<EvaluationPoint>| {
                let returns: Vec<f64> =
                    runs.iter().filter_map(point).map(|point| point.mean_return).collect();
                mean(&returns, CONFIDENCE)
            };
            AgentSummary {
                agent: runs[0].agent.clone(),
                seeds: runs.iter().filter(|run| run.last.is_some()).count(),
                best: over_seeds(|run| run.best),
                last: over_seeds(|run| run.last),
            }
        })
        .collect()
}

/// The table of agents.
pub(super) fn shown(agents: &[AgentSummary]) -> String {
    let cell = |estimate: &Option<Estimate>| match estimate {
        None => "none yet".to_owned(),
        Some(Estimate { value, interval: None }) => format!("{value:.2}"),
        Some(Estimate { value, interval: Some(interval) }) => {
            format!("{value:.2} ({:.2} to {:.2})", interval.low, interval.high)
        }
    };
    let mut rows = table(1, &["agent", "seeds", "best evaluation (95 %)", "last evaluation (95 %)"]);
    for agent in agents {
        rows.add_row([agent.agent.clone(), agent.seeds.to_string(), cell(&agent.best), cell(&agent.last)]);
    }
    rows.to_string()
}
