//! `searoom train`: trains an agent in a folder that can be stopped and resumed at any time.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use indicatif::ProgressBar;

use super::agent_run::{EnvMaker, TracksPart};
use super::agent_training::{self, Pace, Watcher};
use super::progress;
use crate::agent::{RunConfig, run_config};
use crate::env::EnvName;
use crate::env::open_water::MotionKind;
use crate::nn::Compute;
use crate::rl::agent::Algorithm;

/// Options of `searoom train`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom train --env open-water --motion periodic --algorithm lstm-sac --seed 1 --steps 200000 --out runs/periodic
  searoom train --env open-water --algorithm lstm-td3 --no-estimates --out runs/baseline
  searoom train --env coastal --algorithm lstm-sac --seed 1 --steps 200000 --out runs/coastal
  searoom train --config my-run.toml --out runs/mine
  searoom train --resume runs/periodic

The folder then holds config.toml (every setting in use), progress.csv and evaluations.csv, an event file for
TensorBoard with the tags of Stable-Baselines3, a checkpoint (to resume from; the same run to the last bit)
and policy.safetensors (the weights with the best evaluation). Ctrl-C writes a checkpoint and ends.")]
pub struct Args {
    /// Folder of the run; made if it is not there.
    #[arg(long, required_unless_present = "resume", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with the run in this folder; --steps may raise its end.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["config", "env", "algorithm", "motion", "no_estimates", "seed"])]
    resume: Option<PathBuf>,
    /// Settings (TOML); options of the command line come on top.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Environment.
    #[arg(long, value_name = "open-water|coastal")]
    env: Option<EnvName>,
    /// Learning algorithm.
    #[arg(long, value_parser = parse_algorithm, value_name = "lstm-td3|lstm-sac")]
    algorithm: Option<Algorithm>,
    /// Motion of the obstacles in open water.
    #[arg(long, value_parser = parse_motion, value_name = "stochastic|periodic")]
    motion: Option<MotionKind>,
    /// The baseline: no estimates of the collision risk in the observation.
    #[arg(long)]
    no_estimates: bool,
    /// Seed of everything random in the run.
    #[arg(long)]
    seed: Option<u64>,
    /// Decisions to train on.
    #[arg(long)]
    steps: Option<u64>,
    /// Threads to compute on; the result is the same for any number.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    #[command(flatten)]
    pace: Pace,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    args.pace.check()?;
    let (folder, config) = resolve(&args)?;
    let mut envs = EnvMaker::new(&config, TracksPart::Training)?;
    envs.share_forecasts(config.steps)?;
    let compute = Compute::new(args.threads.max(1));
    let watcher = Terminal { bar: progress::steps(config.steps, "training"), interrupted: interrupted()? };
    let started = Instant::now();
    let ending = agent_training::train(&folder, &config, &envs, compute, &args.pace, &watcher)?;
    if ending.finished {
        watcher.bar.finish_and_clear();
    } else {
        watcher.bar.abandon();
    }
    let took_s = started.elapsed().as_secs_f64();
    writeln!(
        out,
        "{} at {} of {} decisions ({} of them in {took_s:.0} s, {:.0} per second); best evaluation {}",
        if ending.finished { "finished" } else { "stopped" },
        ending.step,
        config.steps,
        ending.made,
        ending.made as f64 / took_s,
        ending.best.map_or_else(|| "none yet".to_owned(), |best| format!("{best:.2}")),
    )?;
    let next = if ending.finished { "evaluate" } else { "train --resume" };
    writeln!(out, "next: searoom {next} {}", folder.display())?;
    Ok(())
}

/// A flag that Ctrl-C raises, in place of ending the process.
pub(super) fn interrupted() -> anyhow::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed)).context("cannot watch for Ctrl-C")?;
    Ok(flag)
}

/// One run in a terminal: a bar, and Ctrl-C.
struct Terminal {
    bar: ProgressBar,
    interrupted: Arc<AtomicBool>,
}

impl Watcher for Terminal {
    fn starts_at(&self, step: u64) {
        self.bar.set_position(step);
        self.bar.reset_eta();
    }

    fn advanced(&self) {
        self.bar.inc(1);
    }

    fn evaluated(&self, mean_return: f64) {
        self.bar.set_message(format!("return {mean_return:.2}"));
    }

    fn wants_stop(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

fn resolve(args: &Args) -> anyhow::Result<(PathBuf, RunConfig)> {
    if let Some(folder) = &args.resume {
        let mut config = run_config(folder)?;
        config.steps = args.steps.unwrap_or(config.steps);
        config.check()?;
        return Ok((folder.clone(), config));
    }
    let folder = args.out.clone().context("--out is missing: name a folder for the run")?;
    if agent_training::has_run(&folder) {
        bail!(
            "{} has a run already: go on with it (searoom train --resume {}) or choose another --out",
            folder.display(),
            folder.display()
        );
    }
    let mut config = match &args.config {
        Some(file) => RunConfig::load(file, args.env)?,
        None => RunConfig::of(args.env.unwrap_or_default()),
    };
    config.steps = args.steps.unwrap_or(config.steps);
    config.estimates &= !args.no_estimates;
    config.open_water.motion = args.motion.unwrap_or(config.open_water.motion);
    config.trainer.seed = args.seed.unwrap_or(config.trainer.seed);
    config.trainer.agent.algorithm = args.algorithm.unwrap_or(config.trainer.agent.algorithm);
    config.check()?;
    Ok((folder, config))
}

fn parse_algorithm(text: &str) -> Result<Algorithm, String> {
    match text {
        "lstm-td3" => Ok(Algorithm::LstmTd3),
        "lstm-sac" => Ok(Algorithm::LstmSac),
        _ => Err("choose lstm-td3 or lstm-sac".into()),
    }
}

fn parse_motion(text: &str) -> Result<MotionKind, String> {
    match text {
        "stochastic" => Ok(MotionKind::Stochastic),
        "periodic" => Ok(MotionKind::Periodic),
        _ => Err("choose stochastic or periodic".into()),
    }
}
