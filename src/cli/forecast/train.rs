//! `searoom forecast train`: a run in a folder that can be stopped and resumed at any time.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use indicatif::ProgressBar;

use super::data;
use crate::atomic_file;
use crate::cli::progress;
use crate::config;
use crate::forecast::{Model, ModelConfig, Trainer, Update};
use crate::nn::weights::WeightsFile;
use crate::report::event_file::EventWriter;

/// Options of `searoom forecast train`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom forecast train --config models/open-water-periodic.toml --out runs/periodic
  searoom forecast train --config models/coastal-ny-lower-bay.toml --out runs/coastal --threads 2
  searoom forecast train --out runs/coastal --resume

The folder then holds config.toml (every setting in use), log.csv and an event file for TensorBoard,
checkpoint.safetensors (to resume from; the same run to the last bit) and model.safetensors (to use).
Ctrl-C writes a checkpoint and ends.")]
pub struct TrainArgs {
    /// What to train, on what and how (TOML); with --resume the folder's own config.toml.
    #[arg(long, required_unless_present = "resume")]
    config: Option<PathBuf>,
    /// Folder of the run; made if it is not there.
    #[arg(long)]
    out: PathBuf,
    /// Go on from the folder's checkpoint.
    #[arg(long)]
    resume: bool,
    /// Seed, instead of the configured one.
    #[arg(long)]
    seed: Option<u64>,
    /// Threads to compute on; the result is the same for any number.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Stop after this many updates in all, with a checkpoint, as Ctrl-C would.
    #[arg(long)]
    stop_after: Option<u64>,
    /// Updates between two lines of the log.
    #[arg(long, default_value_t = 50)]
    log_every: u64,
    /// Updates between two checkpoints.
    #[arg(long, default_value_t = 1000)]
    checkpoint_every: u64,
}

const CONFIG: &str = "config.toml";
const LOG: &str = "log.csv";
const CHECKPOINT: &str = "checkpoint.safetensors";
const MODEL: &str = "model.safetensors";
const LOG_HEADER: &str = "step,loss_m,learning_rate,gradient_norm";

pub(super) fn run(args: &TrainArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let checkpoint = args.out.join(CHECKPOINT);
    if !args.resume && checkpoint.exists() {
        bail!("{} has a run already: go on with it (--resume) or choose another --out", args.out.display());
    }
    if args.log_every == 0 || args.checkpoint_every == 0 {
        bail!("--log-every and --checkpoint-every count updates: give 1 or more");
    }
    let file = match &args.config {
        Some(file) => file.clone(),
        None => args.out.join(CONFIG),
    };
    let mut config = config::load_checked(&file, ModelConfig::check)?;
    config.training.seed = args.seed.unwrap_or(config.training.seed);
    let training = data::training_source(&config)?;
    let mut trainer = Trainer::new(config.kind, config.training.clone(), training.source, args.threads)?;
    if let Some(start) = &config.training.start_from
        && !args.resume
    {
        trainer.start_from(start, &Model::open(Path::new(start))?)?;
    }
    if args.resume {
        trainer.resume(&config, WeightsFile::open(&checkpoint)?)?;
    }
    let resolved = toml::to_string_pretty(&config)?;
    atomic_file::write(&args.out.join(CONFIG), |out| out.write_all(resolved.as_bytes()))?;

    let run = Run { args, config: &config, origin: training.origin };
    let started = Instant::now();
    let before = trainer.step();
    let finished = run.train(&mut trainer)?;
    let took_s = started.elapsed().as_secs_f64();
    writeln!(
        out,
        "{}: {} of {} updates ({} of them in {took_s:.0} s), model in {}",
        if finished { "trained" } else { "stopped" },
        trainer.step(),
        config.training.total_steps(),
        trainer.step() - before,
        args.out.join(MODEL).display(),
    )?;
    if !finished {
        writeln!(out, "go on with: searoom forecast train --out {} --resume", args.out.display())?;
    }
    Ok(())
}

struct Run<'a> {
    args: &'a TrainArgs,
    config: &'a ModelConfig,
    origin: Option<crate::geo::Geodetic>,
}

impl Run<'_> {
    /// Trains to the end, or until interrupted; tells which.
    fn train(&self, trainer: &mut Trainer) -> anyhow::Result<bool> {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot watch for Ctrl-C")?;
        let bar = progress::steps(self.config.training.total_steps(), &self.config.name);
        bar.set_position(trainer.step());
        bar.reset_eta();
        let mut log = Log::open(&self.args.out, trainer.step())?;
        let stop_after = self.args.stop_after.unwrap_or(u64::MAX);
        while !interrupted.load(Ordering::Relaxed) && trainer.step() < stop_after {
            let Some(update) = trainer.update() else {
                self.save(trainer)?;
                log.write(&bar)?;
                bar.finish_and_clear();
                return Ok(true);
            };
            bar.inc(1);
            log.add(update);
            if update.step % self.args.log_every == 0 {
                log.write(&bar)?;
            }
            if update.step % self.args.checkpoint_every == 0 {
                self.save(trainer)?;
            }
        }
        self.save(trainer)?;
        log.write(&bar)?;
        bar.abandon();
        Ok(false)
    }

    fn save(&self, trainer: &Trainer) -> anyhow::Result<()> {
        Model::of(trainer, self.config, self.origin).to_file().save(&self.args.out.join(MODEL))?;
        trainer.checkpoint(self.config, self.origin).save(&self.args.out.join(CHECKPOINT))?;
        Ok(())
    }
}

/// The loss over updates, as CSV and for TensorBoard.
struct Log {
    csv: BufWriter<File>,
    events: EventWriter<BufWriter<File>>,
    loss_m: f64,
    gradient_norm: f64,
    last: Option<Update>,
    count: u64,
}

impl Log {
    /// Goes on after `step`: lines of later updates, which a stopped run may have left, are dropped.
    fn open(folder: &Path, step: u64) -> anyhow::Result<Self> {
        let path = folder.join(LOG);
        let old = if step > 0 { std::fs::read_to_string(&path).unwrap_or_default() } else { String::new() };
        let kept = old.lines().skip(1).filter(|line| {
            line.split(',').next().and_then(|first| first.parse::<u64>().ok()).is_some_and(|at| at <= step)
        });
        let text: String = std::iter::once(LOG_HEADER).chain(kept).flat_map(|line| [line, "\n"]).collect();
        atomic_file::write(&path, |out| out.write_all(text.as_bytes()))?;
        let csv = OpenOptions::new().append(true).open(&path).with_context(|| path.display().to_string())?;
        let name = format!("events.out.tfevents.{:010}.searoom.{step}", unix_s() as u64);
        let events = folder.join(name);
        let events = File::create(&events).with_context(|| events.display().to_string())?;
        Ok(Self {
            csv: BufWriter::new(csv),
            events: EventWriter::new(BufWriter::new(events), unix_s())?,
            loss_m: 0.0,
            gradient_norm: 0.0,
            last: None,
            count: 0,
        })
    }

    fn add(&mut self, update: Update) {
        self.loss_m += update.loss_m;
        self.gradient_norm += update.gradient_norm;
        self.last = Some(update);
        self.count += 1;
    }

    /// Writes the mean of the updates since the last line.
    fn write(&mut self, bar: &ProgressBar) -> anyhow::Result<()> {
        let Some(update) = self.last.take() else { return Ok(()) };
        let count = self.count as f64;
        let (loss_m, gradient_norm) = (self.loss_m / count, self.gradient_norm / count);
        let Update { step, learning_rate, .. } = update;
        writeln!(self.csv, "{step},{loss_m},{learning_rate},{gradient_norm}")?;
        self.csv.flush()?;
        let values = [("loss_m", loss_m), ("learning_rate", learning_rate), ("gradient_norm", gradient_norm)];
        self.events.scalars(unix_s(), step, &values)?;
        self.events.flush()?;
        bar.set_message(format!("{loss_m:.3} m"));
        (self.loss_m, self.gradient_norm, self.count) = (0.0, 0.0, 0);
        Ok(())
    }
}

/// The time of day goes into event files, never into results.
fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}
