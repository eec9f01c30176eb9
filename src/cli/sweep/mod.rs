//! `searoom sweep`: trains a grid of agents and seeds over the available cores, resumable at any time.

use std::collections::HashMap;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use indicatif::ProgressBar;

use super::agent_run::{EnvMaker, TracksPart};
use super::agent_training::{self, Pace, Watcher, has_run};
use super::progress;
use super::train::interrupted;
use crate::agent::{RunConfig, run_config};
use crate::config::first_difference;
use crate::nn::Compute;
use crate::rl::checkpoint;

mod plan;
mod summary;

use plan::{PlannedRun, SweepConfig};
use summary::RunSummary;

/// Options of `searoom sweep`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom sweep models/training/sweep-coastal.toml
  searoom sweep models/training/sweep-coastal.toml --list
  searoom sweep my-sweep.toml --jobs 4 --json

A sweep file:
  steps = 150_000
  seeds = [1, 2, 3]
  env = [\"open-water\"]                    # axes of the grid: env, motion, algorithm, estimates, history_len
  motion = [\"stochastic\", \"periodic\"]
  algorithm = [\"lstm-td3\", \"lstm-sac\"]
  estimates = [true, false]
  [settings.trainer]                      # settings of every run, as for searoom train --config
  evaluate_every = 5000
  [grid]                                  # further axes: any key of the settings
  \"trainer.agent.hidden\" = [64, 128]

Each run has a folder of its own, below `out` (default: runs), which is that of `searoom train`: runs that were begun by
hand are gone on with, finished ones are skipped. Ctrl-C writes checkpoints and ends; the same command goes on to the same
bits. A summary with one line per run is written beside the folders, as NAME.csv for a sweep file NAME.toml.")]
pub struct Args {
    /// The sweep file.
    file: PathBuf,
    /// Runs at the same time, one core each [default: all cores].
    #[arg(long)]
    jobs: Option<usize>,
    /// Only list the runs and how far they are.
    #[arg(long)]
    list: bool,
    /// Print JSON instead of tables.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    pace: Pace,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    args.pace.check()?;
    let sweep = SweepConfig::load(&args.file)?;
    let runs = sweep.runs().with_context(|| args.file.display().to_string())?;
    let done = runs.iter().map(step_of).collect::<anyhow::Result<Vec<_>>>()?;
    if args.list {
        return list(&args, &runs, &done, out);
    }
    let outcome = train_all(&args, &runs, &done)?;
    let summaries = runs.iter().map(RunSummary::of).collect::<anyhow::Result<Vec<_>>>()?;
    let stem = args.file.file_stem().unwrap_or(args.file.as_os_str());
    let csv = sweep.out.join(format!("{}.csv", stem.to_string_lossy()));
    summary::write_csv(&csv, sweep.grid_keys(), &summaries)?;
    let agents = summary::by_agent(&summaries);
    if args.json {
        let json = serde_json::json!({
            "finished": outcome.unfinished == 0, "csv": csv, "runs": summaries, "agents": agents,
        });
        writeln!(out, "{json}")?;
    } else {
        writeln!(out, "{}", summary::shown(&agents))?;
        writeln!(out, "one line per run: {}", csv.display())?;
        if outcome.unfinished > 0 {
            let of = runs.len();
            writeln!(out, "{} of {of} runs are not finished; the same command goes on", outcome.unfinished)?;
        }
    }
    match outcome.failures.as_slice() {
        [] => Ok(()),
        failures => bail!("{} run(s) failed: {}", failures.len(), failures.join("; ")),
    }
}

/// Decisions that a run has behind it. A folder that has a run of another configuration is an error.
fn step_of(run: &PlannedRun) -> anyhow::Result<u64> {
    if !has_run(&run.folder) {
        return Ok(0);
    }
    // The end may be another: a run can be gone on with.
    let theirs = RunConfig { steps: run.config.steps, ..run_config(&run.folder)? };
    if let Some((key, theirs, ours)) = first_difference(&theirs, &run.config) {
        bail!(
            "{} has a run of another configuration: `{key}` is {theirs} there and {ours} in the sweep; move that \
             folder away or change the sweep",
            run.folder.display()
        );
    }
    if !run.folder.join(checkpoint::FILE).exists() {
        return Ok(0);
    }
    Ok(checkpoint::step(&run.folder)?)
}

fn list(args: &Args, runs: &[PlannedRun], done: &[u64], out: &mut dyn Write) -> anyhow::Result<()> {
    if args.json {
        let of = |(run, step): (&PlannedRun, &u64)| serde_json::json!({ "run": run.name(), "folder": run.folder, "step": step, "steps": run.config.steps });
        let list: Vec<_> = runs.iter().zip(done).map(of).collect();
        writeln!(out, "{}", serde_json::Value::from(list))?;
        return Ok(());
    }
    let mut rows = super::table::table(1, &["run", "decisions", "of"]);
    for (run, step) in runs.iter().zip(done) {
        rows.add_row([run.name(), step.to_string(), run.config.steps.to_string()]);
    }
    writeln!(out, "{rows}")?;
    Ok(())
}

/// How the runs of a sweep ended.
struct Outcome {
    unfinished: usize,
    failures: Vec<String>,
}

/// Trains what is not finished, `jobs` runs at a time.
fn train_all(args: &Args, runs: &[PlannedRun], done: &[u64]) -> anyhow::Result<Outcome> {
    let pending: Vec<&PlannedRun> =
        runs.iter().zip(done).filter(|(run, step)| **step < run.config.steps).map(|(run, _)| run).collect();
    let total = runs.iter().map(|run| run.config.steps).sum();
    let shared = Shared {
        bar: progress::steps(total, ""),
        interrupted: interrupted()?,
        next: AtomicUsize::new(0),
        finished: AtomicUsize::new(runs.len() - pending.len()),
        of: runs.len(),
        failures: Mutex::new(Vec::new()),
        envs: Mutex::new(HashMap::new()),
    };
    shared.bar.set_position(runs.iter().zip(done).map(|(run, step)| run.config.steps.min(*step)).sum());
    shared.bar.reset_eta();
    shared.show();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.unwrap_or(cores).clamp(1, pending.len().max(1));
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| shared.work(&pending, &args.pace));
        }
    });
    shared.bar.finish_and_clear();
    let failures = shared.failures.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(Outcome { unfinished: runs.len() - shared.finished.into_inner(), failures })
}

/// What the threads of a sweep share.
struct Shared {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
    next: AtomicUsize,
    finished: AtomicUsize,
    of: usize,
    failures: Mutex<Vec<String>>,
    /// Environments by what they depend on: tracks and forecasters are loaded once.
    envs: Mutex<HashMap<String, Arc<EnvMaker>>>,
}

impl Shared {
    /// Takes run after run until none is left.
    fn work(&self, pending: &[&PlannedRun], pace: &Pace) {
        while !self.wants_stop() {
            let Some(run) = pending.get(self.next.fetch_add(1, Ordering::Relaxed)) else { return };
            match self.train(run, pace) {
                Ok(true) => {
                    self.finished.fetch_add(1, Ordering::Relaxed);
                }
                Ok(false) => {}
                Err(error) => {
                    let failure = format!("{}: {error:#}", run.name());
                    self.failures.lock().unwrap_or_else(PoisonError::into_inner).push(failure);
                }
            }
            self.show();
        }
    }

    fn train(&self, run: &PlannedRun, pace: &Pace) -> anyhow::Result<bool> {
        let envs = self.envs_of(&run.config)?;
        let compute = Compute::new(1);
        let ending = agent_training::train(&run.folder, &run.config, &envs, compute, pace, self)?;
        Ok(ending.finished)
    }

    fn envs_of(&self, config: &RunConfig) -> anyhow::Result<Arc<EnvMaker>> {
        let key = config.environment_key();
        // Held while loading: the others wait for the same tracks instead of importing them again.
        let mut envs = self.envs.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(envs) = envs.get(&key) {
            return Ok(Arc::clone(envs));
        }
        let mut made = EnvMaker::new(config, TracksPart::Training)?;
        made.share_forecasts(config.steps)?;
        let made = Arc::new(made);
        envs.insert(key, Arc::clone(&made));
        Ok(made)
    }

    fn show(&self) {
        self.bar.set_message(format!("{} of {} runs", self.finished.load(Ordering::Relaxed), self.of));
    }
}

impl Watcher for Shared {
    fn starts_at(&self, _step: u64) {}

    fn advanced(&self) {
        self.bar.inc(1);
    }

    fn evaluated(&self, _mean_return: f64) {}

    fn wants_stop(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}
