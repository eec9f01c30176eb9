//! `searoom train`: trains an agent in a folder that can be stopped and resumed at any time.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use indicatif::ProgressBar;

use super::agent_run::{CONFIG, EnvMaker, EnvName, POLICY, RunConfig, TracksPart};
use super::progress;
use super::run_log::{CsvLog, open_events, unix_s};
use crate::atomic_file;
use crate::env::Env;
use crate::env::open_water::MotionKind;
use crate::nn::Compute;
use crate::report::event_file::EventWriter;
use crate::rl::agent::Algorithm;
use crate::rl::checkpoint::{self, CheckpointWriter};
use crate::rl::trainer::{Evaluation, FinishedEpisode, Trainer};

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
    #[arg(long, value_enum)]
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
    /// Decisions between two checkpoints.
    #[arg(long, default_value_t = 10_000)]
    checkpoint_every: u64,
    /// Decisions between two lines of progress.csv.
    #[arg(long, default_value_t = 1000)]
    log_every: u64,
}

/// Episodes that `rollout/ep_rew_mean` is taken over, as in Stable-Baselines3.
const ROLLOUT_WINDOW: usize = 100;
const PROGRESS: &str = "progress.csv";
const PROGRESS_TAGS: [&str; 7] = [
    "rollout/ep_rew_mean",
    "rollout/ep_len_mean",
    "train/critic_loss",
    "train/actor_loss",
    "train/ent_coef_loss",
    "train/ent_coef",
    "train/n_updates",
];
const EVALUATIONS: &str = "evaluations.csv";

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    if args.checkpoint_every == 0 || args.log_every == 0 {
        bail!("--checkpoint-every and --log-every count decisions: give 1 or more");
    }
    let (folder, config) = resolve(&args)?;
    let compute = Compute::new(args.threads.max(1));
    let envs = EnvMaker::new(&config, TracksPart::Training)?;
    let mut trainer = Trainer::new(config.trainer.clone(), envs.make()?, compute);
    let checkpoints = if args.resume.is_some() {
        checkpoint::load(&folder, &mut trainer)?
    } else {
        CheckpointWriter::new(&folder)
    };
    let resolved = toml::to_string_pretty(&config)?;
    atomic_file::write(&folder.join(CONFIG), |file| file.write_all(resolved.as_bytes()))?;

    let (before, started) = (trainer.step(), Instant::now());
    let mut run = Run::open(&args, folder, config, checkpoints, envs.make()?, trainer.step())?;
    let finished = run.train(&mut trainer)?;
    let (made, took_s) = (trainer.step() - before, started.elapsed().as_secs_f64());
    writeln!(
        out,
        "{} at {} of {} decisions ({made} of them in {took_s:.0} s, {:.0} per second); best evaluation {}",
        if finished { "finished" } else { "stopped" },
        trainer.step(),
        run.config.steps,
        made as f64 / took_s,
        run.best.map_or_else(|| "none yet".to_owned(), |best| format!("{best:.2}")),
    )?;
    let next = if finished { "evaluate" } else { "train --resume" };
    writeln!(out, "next: searoom {next} {}", run.folder.display())?;
    Ok(())
}

fn resolve(args: &Args) -> anyhow::Result<(PathBuf, RunConfig)> {
    if let Some(folder) = &args.resume {
        let mut config = RunConfig::of_run(folder)?;
        config.steps = args.steps.unwrap_or(config.steps);
        return Ok((folder.clone(), config));
    }
    let folder = args.out.clone().context("--out is missing: name a folder for the run")?;
    if folder.join(CONFIG).exists() || folder.join(checkpoint::FILE).exists() {
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

/// A run under way: where it writes, and what it has seen.
struct Run {
    folder: PathBuf,
    config: RunConfig,
    checkpoint_every: u64,
    log_every: u64,
    checkpoints: CheckpointWriter,
    evaluation_env: Box<dyn Env>,
    progress: CsvLog,
    evaluations: CsvLog,
    events: EventWriter<BufWriter<File>>,
    episodes: VecDeque<FinishedEpisode>,
    best: Option<f64>,
}

impl Run {
    fn open(
        args: &Args,
        folder: PathBuf,
        config: RunConfig,
        checkpoints: CheckpointWriter,
        evaluation_env: Box<dyn Env>,
        step: u64,
    ) -> anyhow::Result<Self> {
        let header = |tags: &[&str]| format!("step,{}", tags.join(","));
        let evaluations = folder.join(EVALUATIONS);
        let log = CsvLog::open(&evaluations, "step,mean_return,sd_return,mean_decisions,episodes", step)?;
        Ok(Self {
            progress: CsvLog::open(&folder.join(PROGRESS), &header(&PROGRESS_TAGS), step)?,
            evaluations: log,
            best: best_so_far(&evaluations)?,
            events: open_events(&folder, step)?,
            evaluation_env,
            checkpoint_every: args.checkpoint_every,
            log_every: args.log_every,
            episodes: VecDeque::new(),
            checkpoints,
            folder,
            config,
        })
    }

    /// Trains to the end, or until interrupted; tells which.
    fn train(&mut self, trainer: &mut Trainer) -> anyhow::Result<bool> {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot watch for Ctrl-C")?;
        let bar = progress::steps(self.config.steps, "training");
        bar.set_position(trainer.step());
        bar.reset_eta();
        while trainer.step() < self.config.steps && !interrupted.load(Ordering::Relaxed) {
            if let Some(episode) = trainer.advance() {
                if self.episodes.len() == ROLLOUT_WINDOW {
                    self.episodes.pop_front();
                }
                self.episodes.push_back(episode);
            }
            bar.inc(1);
            let step = trainer.step();
            if step.is_multiple_of(self.log_every) {
                self.log_progress(trainer)?;
            }
            if trainer.evaluation_is_due() {
                let evaluation = trainer.evaluate(self.evaluation_env.as_mut());
                self.keep_evaluation(trainer, &evaluation, &bar)?;
            }
            if step.is_multiple_of(self.checkpoint_every) {
                self.checkpoints.save(trainer)?;
            }
        }
        self.checkpoints.save(trainer)?;
        let finished = trainer.step() >= self.config.steps;
        if finished {
            bar.finish_and_clear()
        } else {
            bar.abandon()
        }
        Ok(finished)
    }

    fn log_progress(&mut self, trainer: &mut Trainer) -> anyhow::Result<()> {
        let mean = |value: fn(&FinishedEpisode) -> f64| {
            let count = self.episodes.len();
            (count > 0).then(|| self.episodes.iter().map(value).sum::<f64>() / count as f64)
        };
        let rollout = [mean(|episode| episode.total_reward), mean(|episode| episode.decisions as f64)];
        let updates = trainer.agent().updates() as f64;
        let scalar =
            |tag: &str| trainer.scalars().iter().find(|scalar| scalar.tag == tag).map(|scalar| scalar.value);
        let values: Vec<Option<f64>> = PROGRESS_TAGS
            .iter()
            .map(|tag| match *tag {
                "rollout/ep_rew_mean" => rollout[0],
                "rollout/ep_len_mean" => rollout[1],
                "train/n_updates" => Some(updates),
                tag => scalar(tag),
            })
            .collect();
        self.progress.write(trainer.step(), &values)?;
        let known: Vec<(&str, f64)> =
            PROGRESS_TAGS.into_iter().zip(values).filter_map(|(tag, value)| Some((tag, value?))).collect();
        self.events.scalars(unix_s(), trainer.step(), &known)?;
        Ok(self.events.flush()?)
    }

    /// Logs an evaluation, and keeps the weights where it is the best so far.
    fn keep_evaluation(
        &mut self,
        trainer: &mut Trainer,
        evaluation: &Evaluation,
        bar: &ProgressBar,
    ) -> anyhow::Result<()> {
        let mean = evaluation.mean_return();
        let count = evaluation.returns.len() as f64;
        let sd = (evaluation.returns.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0))
            .sqrt();
        let decisions = evaluation.mean_decisions();
        if self.best.is_none_or(|best| mean > best) {
            let policy = checkpoint::policy_weights(trainer.agent());
            policy.fact("step", evaluation.step).fact("mean_return", mean).save(&self.folder.join(POLICY))?;
            self.best = Some(mean);
        }
        let sd = sd.is_finite().then_some(sd);
        self.evaluations.write(evaluation.step, &[Some(mean), sd, Some(decisions), Some(count)])?;
        let values = [("eval/mean_reward", mean), ("eval/mean_ep_length", decisions)];
        self.events.scalars(unix_s(), evaluation.step, &values)?;
        bar.set_message(format!("return {mean:.2}"));
        Ok(())
    }
}

/// The best mean return of the evaluations that a resumed run has behind it.
fn best_so_far(file: &Path) -> anyhow::Result<Option<f64>> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let returns = text.lines().skip(1).filter_map(|line| line.split(',').nth(1)?.parse::<f64>().ok());
    Ok(returns.fold(None, |best: Option<f64>, value| Some(best.map_or(value, |best| best.max(value)))))
}
