//! One training run in its folder: what `searoom train` and `searoom sweep` share.
//!
//! The folder holds the resolved configuration, the logs, the checkpoint and the best policy. A run goes on
//! from its checkpoint with the bits it would have had; a lock keeps two processes from the same folder.

use std::fs::{self, File, TryLockError};
use std::io::BufWriter;
use std::path::Path;

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

use super::agent_run::EnvMaker;
use super::run_log::{CsvLog, open_events, unix_s};
use crate::agent::{CONFIG, POLICY, RunConfig, TrainedAgent};
use crate::atomic_file;
use crate::env::Env;
use crate::nn::Compute;
use crate::report::event_file::EventWriter;
use crate::rl::checkpoint::{self, CheckpointWriter};
use crate::rl::trainer::{Evaluation, FinishedEpisode, Trainer};

/// How a run is driven; nothing here changes its result.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct Pace {
    /// Decisions between two checkpoints.
    #[arg(long, default_value_t = 10_000)]
    checkpoint_every: u64,
    /// Decisions between two lines of progress.csv.
    #[arg(long, default_value_t = 1000)]
    log_every: u64,
}

impl Pace {
    /// Refuses intervals of nothing.
    pub fn check(&self) -> anyhow::Result<()> {
        if self.checkpoint_every == 0 || self.log_every == 0 {
            bail!("--checkpoint-every and --log-every count decisions: give 1 or more");
        }
        Ok(())
    }
}

/// Who follows a run and may stop it.
pub(super) trait Watcher {
    /// The run begins, or goes on, at this step.
    fn starts_at(&self, step: u64);
    /// One more decision was made.
    fn advanced(&self);
    /// An evaluation gave this mean return.
    fn evaluated(&self, mean_return: f64);
    /// Whether to stop with a checkpoint.
    fn wants_stop(&self) -> bool;
}

/// What came of a run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ending {
    /// Decisions made in all.
    pub step: u64,
    /// Those of them made now.
    pub made: u64,
    /// Whether it is at its end.
    pub finished: bool,
    /// The best mean return of its evaluations.
    pub best: Option<f64>,
}

/// Whether a folder has a run, or the beginnings of one.
pub(super) fn has_run(folder: &Path) -> bool {
    folder.join(CONFIG).exists() || folder.join(checkpoint::FILE).exists()
}

/// Trains in `folder` to the end of the run or until the watcher stops it: from the beginning, or from the
/// checkpoint where there is one.
pub(super) fn train(
    folder: &Path,
    config: &RunConfig,
    envs: &EnvMaker,
    compute: Compute,
    pace: &Pace,
    watcher: &dyn Watcher,
) -> anyhow::Result<Ending> {
    let _lock = lock(folder)?;
    remove_leftovers(folder)?;
    let mut trainer = Trainer::new(config.trainer.clone(), envs.make()?, compute);
    let checkpoints = if folder.join(checkpoint::FILE).exists() {
        checkpoint::load(folder, &mut trainer)?
    } else {
        CheckpointWriter::new(folder)
    };
    let resolved = toml::to_string_pretty(config)?;
    atomic_file::write(&folder.join(CONFIG), |file| file.write_all(resolved.as_bytes()))?;
    let before = trainer.step();
    watcher.starts_at(before);
    let mut run = Run::open(folder, config, envs.make()?, checkpoints, before)?;
    run.train(&mut trainer, pace, watcher)?;
    let step = trainer.step();
    Ok(Ending { step, made: step.saturating_sub(before), finished: step >= config.steps, best: run.best })
}

/// Holds the folder for this process; the system lets go of it when the process ends, however it ends.
fn lock(folder: &Path) -> anyhow::Result<File> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let path = folder.join(".lock");
    let file = File::create(&path).with_context(|| path.display().to_string())?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            bail!("{}: another process is training here; wait for it, or stop it first", folder.display())
        }
        Err(TryLockError::Error(error)) => Err(error).with_context(|| path.display().to_string()),
    }
}

/// Removes files that a killed process was about to put in place.
fn remove_leftovers(folder: &Path) -> anyhow::Result<()> {
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.is_file() && atomic_file::is_unfinished(&path) {
            fs::remove_file(&path).with_context(|| path.display().to_string())?;
        }
    }
    Ok(())
}

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

/// A run under way: where it writes, and what it has seen.
struct Run<'a> {
    folder: &'a Path,
    config: &'a RunConfig,
    checkpoints: CheckpointWriter,
    evaluation_env: Box<dyn Env>,
    progress: CsvLog,
    evaluations: CsvLog,
    events: EventWriter<BufWriter<File>>,
    best: Option<f64>,
}

impl<'a> Run<'a> {
    fn open(
        folder: &'a Path,
        config: &'a RunConfig,
        evaluation_env: Box<dyn Env>,
        checkpoints: CheckpointWriter,
        step: u64,
    ) -> anyhow::Result<Self> {
        let header = |tags: &[&str]| format!("step,{}", tags.join(","));
        let evaluations = folder.join(EVALUATIONS);
        let log = CsvLog::open(&evaluations, "step,mean_return,sd_return,mean_decisions,episodes", step)?;
        let best = evaluations_of(folder)?.into_iter().map(|point| point.mean_return).reduce(f64::max);
        Ok(Self {
            progress: CsvLog::open(&folder.join(PROGRESS), &header(&PROGRESS_TAGS), step)?,
            evaluations: log,
            best,
            events: open_events(folder, step)?,
            evaluation_env,
            checkpoints,
            folder,
            config,
        })
    }

    fn train(&mut self, trainer: &mut Trainer, pace: &Pace, watcher: &dyn Watcher) -> anyhow::Result<()> {
        while trainer.step() < self.config.steps && !watcher.wants_stop() {
            trainer.advance();
            watcher.advanced();
            let step = trainer.step();
            if step.is_multiple_of(pace.log_every) {
                self.log_progress(trainer)?;
            }
            if trainer.evaluation_is_due() {
                let evaluation = trainer.evaluate(self.evaluation_env.as_mut());
                self.keep_evaluation(trainer, &evaluation)?;
                watcher.evaluated(evaluation.mean_return());
            }
            if step.is_multiple_of(pace.checkpoint_every) {
                self.checkpoints.save(trainer)?;
            }
        }
        Ok(self.checkpoints.save(trainer)?)
    }

    fn log_progress(&mut self, trainer: &mut Trainer) -> anyhow::Result<()> {
        let mean = |value: fn(&FinishedEpisode) -> f64| {
            let episodes = trainer.recent_episodes();
            let count = episodes.len();
            (count > 0).then(|| episodes.iter().map(value).sum::<f64>() / count as f64)
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
    fn keep_evaluation(&mut self, trainer: &mut Trainer, evaluation: &Evaluation) -> anyhow::Result<()> {
        let mean = evaluation.mean_return();
        let count = evaluation.returns.len() as f64;
        let sd = (evaluation.returns.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0))
            .sqrt();
        let decisions = evaluation.mean_decisions();
        if self.best.is_none_or(|best| mean > best) {
            let policy = TrainedAgent::file(self.config, trainer.agent(), evaluation.step, mean);
            policy.save(&self.folder.join(POLICY))?;
            self.best = Some(mean);
        }
        let sd = sd.is_finite().then_some(sd);
        self.evaluations.write(evaluation.step, &[Some(mean), sd, Some(decisions), Some(count)])?;
        let values = [("eval/mean_reward", mean), ("eval/mean_ep_length", decisions)];
        Ok(self.events.scalars(unix_s(), evaluation.step, &values)?)
    }
}

/// One line of a run's evaluations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct EvaluationPoint {
    /// Decisions trained on before it.
    pub step: u64,
    /// Mean return of its episodes.
    pub mean_return: f64,
}

/// The evaluations of the run in a folder so far; none where it has no log yet.
pub(super) fn evaluations_of(folder: &Path) -> anyhow::Result<Vec<EvaluationPoint>> {
    let path = folder.join(EVALUATIONS);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let points = csv::Reader::from_path(&path)?.deserialize().collect::<Result<_, _>>();
    points.with_context(|| format!("{}: no log of evaluations", path.display()))
}
