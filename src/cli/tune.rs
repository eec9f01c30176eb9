//! `searoom tune`: searches settings of a classical policy, on training seeds alone.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use serde::Serialize;

use super::policies::PolicyArgs;
use super::progress;
use super::table::table;
use crate::atomic_file;
use crate::config::{self, ConfigError};
use crate::experiment::tuning::{self, SPACES, Score, Tuned, TuningConfig};

/// Options of `searoom tune`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  searoom tune mpc
  searoom tune velocity-obstacle --candidates 256 --out vo.toml
  searoom benchmark imazu --policies velocity-obstacle --policy-config vo.toml

Encounters with one to three ships are drawn at random; the Imazu problems and the benchmarks' seeds are not among
them. docs/encounters.md has what this found for the defaults.")]
pub struct Args {
    /// The policy
    #[arg(value_parser = SPACES.map(|(name, _)| name))]
    policy: String,
    #[command(flatten)]
    settings: PolicyArgs,
    /// TOML file with settings of the search: losses, rounds, what encounters are drawn
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Settings drawn for the first round
    #[arg(long)]
    candidates: Option<usize>,
    /// Seed of the settings that are drawn
    #[arg(long)]
    seed: Option<u64>,
    /// Write the best settings into this TOML file, for --policy-config
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

fn load(file: &Path) -> Result<TuningConfig, ConfigError> {
    config::load_checked(file, |config: &TuningConfig| {
        config.rules.check().map_err(|fault| fault.within("rules"))
    })
}

/// Runs the command.
pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    let in_force = args.settings.load()?;
    let mut config = args.config.as_deref().map(load).transpose()?.unwrap_or_default();
    config.candidates = args.candidates.unwrap_or(config.candidates);
    config.seed = args.seed.unwrap_or(config.seed);
    ensure!(
        config.candidates > 0 && config.encounters > 0 && config.rounds > 0,
        "candidates, encounters and rounds of a search are 1 or more"
    );
    ensure!(
        !config.drawn.steering.is_empty(),
        "key \"drawn.steering\" is empty: write one way to steer or more"
    );
    let bar = progress::steps(tuning::episodes(&config) as u64, "episodes");
    let tuned = tuning::tune(&args.policy, &in_force, &config, &|| bar.inc(1));
    bar.finish_and_clear();
    let Some(tuned) = tuned else { return Ok(()) };
    let settings = toml::Table::try_from(&tuned.best)?;
    let settings = toml::Table::from_iter(settings.into_iter().filter(|(policy, _)| *policy == tuned.policy));
    let settings = toml::to_string(&settings)?;
    if let Some(file) = &args.out {
        atomic_file::write(file, |out| out.write_all(settings.as_bytes()))?;
    }
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&Outcome::of(&tuned))?)?;
    } else {
        print(&tuned, &settings, out)?;
    }
    Ok(())
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Outcome<'a> {
    #[serde(flatten)]
    tuned: &'a Tuned,
    improved: bool,
}

impl<'a> Outcome<'a> {
    fn of(tuned: &'a Tuned) -> Self {
        Self { tuned, improved: tuned.evaluation.loss < tuned.in_force.loss }
    }
}

fn print(tuned: &Tuned, settings: &str, out: &mut dyn Write) -> anyhow::Result<()> {
    let mut rows = table(1, &["settings", "loss", "contacts", "compliance", "largest cross-track error"]);
    let scores: [(&str, Score); 3] = [
        ("best, training", tuned.training),
        ("best, unseen encounters", tuned.evaluation),
        ("in force, unseen encounters", tuned.in_force),
    ];
    for (name, score) in scores {
        rows.add_row([
            name.to_owned(),
            format!("{:.3}", score.loss),
            format!("{:.1} %", 100.0 * score.contact_rate),
            format!("{:.2}", score.compliance),
            format!("{:.0} m", score.cross_track_m),
        ]);
    }
    writeln!(out, "{rows}\n\n{settings}")?;
    Ok(())
}
