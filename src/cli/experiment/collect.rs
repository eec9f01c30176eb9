//! `searoom experiment collect`: learning curves of finished runs, kept with their settings and commit.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args as ClapArgs;
use serde::Serialize;

use super::runs::{self, LOG};
use crate::atomic_file;
use crate::cli::table::table;
use crate::experiment::curves::{CONFIG, EVALUATIONS, ORIGIN, Origin, run_name, thousands};

/// Options of `searoom experiment collect`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom experiment collect runs/coastal-lstm-sac-seed-1 --out results
  searoom experiment collect runs/* --commit 1a2b3c4d5e --out results

A run is kept as results/NAME/ with evaluations.csv (of a forecaster: log.csv), config.toml with every setting in
use, and origin.toml with the version and the commits that trained it. NAME follows from the settings: of an agent
waters, algorithm, history and seed; of a forecaster its name. Runs of agents that are not finished are
refused, and nothing is written then.")]
pub(super) struct CollectArgs {
    /// Folders of runs
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Folder to keep them in
    #[arg(long, default_value = "results")]
    out: PathBuf,
    /// The commit that trained them, for runs that do not say it themselves
    #[arg(long)]
    commit: Option<String>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A run that is kept.
#[derive(Debug, Serialize)]
struct Kept {
    run: PathBuf,
    name: String,
    steps: u64,
    last: f64,
    commits: Vec<String>,
    #[serde(skip)]
    file: &'static str,
    #[serde(skip)]
    origin: Origin,
}

pub(super) fn run(args: &CollectArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    if let Some(commit) = &args.commit {
        let is_hash = (7..=40).contains(&commit.len()) && commit.bytes().all(|byte| byte.is_ascii_hexdigit());
        ensure!(is_hash, "--commit {commit}: give the 7 to 40 hexadecimal digits of a commit");
    }
    // All are looked at before the first is written.
    let kept: Vec<Kept> =
        args.runs.iter().map(|run| examine(run, args.commit.as_deref())).collect::<anyhow::Result<_>>()?;
    for (index, one) in kept.iter().enumerate() {
        if let Some(other) = kept[..index].iter().find(|other| other.name == one.name) {
            bail!(
                "{} and {} are both {}: keep one of them",
                other.run.display(),
                one.run.display(),
                one.name
            );
        }
    }
    for one in &kept {
        let folder = args.out.join(&one.name);
        for file in [one.file, CONFIG] {
            copy(&one.run.join(file), &folder.join(file))?;
        }
        let origin = toml::to_string(&one.origin)?;
        atomic_file::write(&folder.join(ORIGIN), |file| file.write_all(origin.as_bytes()))?;
    }
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&kept)?)?;
        return Ok(());
    }
    let mut rows = table(1, &["kept as", "steps", "last return or loss", "commit"]);
    for one in &kept {
        rows.add_row([
            args.out.join(&one.name).display().to_string(),
            thousands(one.steps),
            format!("{:.2}", one.last),
            one.origin.short_commits(),
        ]);
    }
    writeln!(out, "{rows}")?;
    Ok(())
}

fn examine(run: &Path, commit: Option<&str>) -> anyhow::Result<Kept> {
    let origin = origin(run, commit)?;
    let commits = origin.commits.clone();
    if run.join(EVALUATIONS).is_file() {
        let curve = runs::curve(run)?;
        let facts = &curve.run;
        let Some(last) = curve.points.last() else {
            bail!(
                "{} has no evaluation yet: train on (searoom train --resume {})",
                run.display(),
                run.display()
            );
        };
        ensure!(
            curve.is_finished(),
            "{} is at {} of {} steps: finish it first (searoom train --resume {})",
            run.display(),
            last.step,
            facts.steps,
            run.display()
        );
        let name = run_name(facts.waters, facts.agent, facts.history_len, facts.seed);
        let (steps, last) = (last.step, last.mean_return);
        return Ok(Kept { run: run.to_owned(), name, steps, last, commits, file: EVALUATIONS, origin });
    }
    if run.join(LOG).is_file() {
        let log = runs::training_log(run)?;
        ensure!(
            !log.name.is_empty(),
            "{}: key \"name\" is empty: name the forecaster",
            run.join(CONFIG).display()
        );
        let (steps, last) = log.lines.last().map_or((0, 0.0), |line| (line.step, line.loss_m));
        return Ok(Kept { run: run.to_owned(), name: log.name, steps, last, commits, file: LOG, origin });
    }
    bail!(
        "{} is no run: it has neither {EVALUATIONS} nor {LOG}; give a folder that `searoom train` or `searoom forecast \
         train` wrote",
        run.display()
    )
}

/// What the folder says trained it, or else the commit given.
fn origin(run: &Path, commit: Option<&str>) -> anyhow::Result<Origin> {
    match (runs::origin(run)?, commit) {
        (Some(origin), None) if !origin.commits.is_empty() => Ok(origin),
        (Some(origin), Some(commit)) if !origin.commits.is_empty() => {
            ensure!(
                origin
                    .commits
                    .iter()
                    .any(|known| known.starts_with(commit) || commit.starts_with(known.as_str())),
                "{}: trained by commit {}, not {commit}; leave --commit out",
                run.join(ORIGIN).display(),
                origin.short_commits()
            );
            Ok(origin)
        }
        (Some(origin), Some(commit)) => Ok(Origin { commits: vec![commit.to_owned()], ..origin }),
        (None, Some(commit)) => {
            Ok(Origin { version: env!("CARGO_PKG_VERSION").to_owned(), commits: vec![commit.to_owned()] })
        }
        (_, None) => bail!(
            "{} does not say which commit trained it: name it with --commit (git rev-parse HEAD, when the program was \
             built)",
            run.display()
        ),
    }
}

fn copy(from: &Path, to: &Path) -> anyhow::Result<()> {
    let bytes = fs::read(from).with_context(|| format!("{}: cannot be read", from.display()))?;
    Ok(atomic_file::write(to, |file| file.write_all(&bytes))?)
}
