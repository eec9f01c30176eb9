//! `searoom scenario import` and `export`: traffic situations in DNV's maritime-schema JSON.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use super::described;
use crate::atomic_file;
use crate::config::Source;
use crate::geo::Geodetic;
use crate::policy;
use crate::scenario::ScenarioFile;
use crate::scenario::maritime_schema::{ImportOptions, VERSION, export, import};
use crate::vessel::Dynamics;

#[derive(Debug, clap::Args)]
pub(super) struct ImportArgs {
    /// Traffic situation (JSON)
    file: PathBuf,
    /// Scenario file to write (TOML)
    #[arg(long)]
    out: PathBuf,
    /// Who steers own ship
    #[arg(long, value_parser = policy::NAMES, default_value = "rule-based")]
    policy: String,
    /// How ships under way move; wind and current act on kvlcc2 alone
    #[arg(long, value_parser = Dynamics::WORDS.map(|(word, _)| word), default_value = "kinematic")]
    dynamics: String,
    /// Time simulated [default: what own ship needs for its route, or 30]
    #[arg(long)]
    duration_min: Option<f64>,
}

#[derive(Debug, clap::Args)]
pub(super) struct ExportArgs {
    /// Scenario file (TOML)
    file: PathBuf,
    /// Traffic situation to write (JSON)
    #[arg(long)]
    out: PathBuf,
    /// Latitude of the origin, for a scenario that is nowhere on the earth
    #[arg(long, requires = "origin_longitude_deg", allow_negative_numbers = true)]
    origin_latitude_deg: Option<f64>,
    /// Longitude of the origin, for a scenario that is nowhere on the earth
    #[arg(long, requires = "origin_latitude_deg", allow_negative_numbers = true)]
    origin_longitude_deg: Option<f64>,
}

pub(super) fn run_import(args: &ImportArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let source = Source::read(&args.file)?;
    let duration_s = args.duration_min.map(|minutes| minutes * 60.0);
    if duration_s.is_some_and(|duration_s| !(1.0..=1e6).contains(&duration_s)) {
        bail!("--duration-min: write a number above 0, and no more than 16666");
    }
    let dynamics = Dynamics::WORDS.into_iter().find(|(word, _)| *word == args.dynamics);
    let options = ImportOptions {
        policy: args.policy.clone(),
        duration_s,
        dynamics: dynamics.map(|(_, dynamics)| dynamics).unwrap_or_default(),
        ..ImportOptions::default()
    };
    let imported = import(&source.text, &args.file, &options)?;
    let text = format!(
        "# Imported from {} (maritime-schema).\n\n{}",
        args.file.file_name().unwrap_or_default().to_string_lossy().replace(['\n', '\r'], " "),
        imported.scenario.to_toml()?
    );
    // Whatever cannot be set up is said before a file is there.
    let staged = ScenarioFile::parse(&text, &args.out)
        .and_then(|file| file.set_up())
        .with_context(|| format!("{}: makes no scenario", args.file.display()))?;
    write(&args.out, &text)?;
    for note in &imported.notes {
        writeln!(out, "{note}")?;
    }
    writeln!(out, "{}: {}", args.out.display(), described(&staged))?;
    writeln!(out, "Run it with: searoom scenario run {}", args.out.display())?;
    Ok(())
}

pub(super) fn run_export(args: &ExportArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let mut file = ScenarioFile::load(&args.file)?;
    if let Some((latitude_deg, longitude_deg)) = args.origin_latitude_deg.zip(args.origin_longitude_deg) {
        let origin = Geodetic { latitude_deg, longitude_deg }.checked();
        let Some(origin) = origin.filter(|origin| origin.latitude_deg.abs() <= 89.9) else {
            bail!(
                "--origin-latitude-deg, --origin-longitude-deg: {latitude_deg}, {longitude_deg} is not on the earth"
            );
        };
        file.scenario.origin = Some(origin);
    }
    let staged = file.set_up()?;
    let situation = export(&staged).with_context(|| {
        format!("{}: give --origin-latitude-deg and --origin-longitude-deg", args.file.display())
    })?;
    write(&args.out, &situation)?;
    let count = staged.targets.len();
    writeln!(out, "{}: maritime-schema {VERSION}, own ship and {count} target ships", args.out.display())?;
    Ok(())
}

fn write(file: &Path, text: &str) -> anyhow::Result<()> {
    atomic_file::write(file, |writer| writer.write_all(text.as_bytes()))?;
    Ok(())
}
