//! `searoom scenario`: scripted encounters, listed, checked and run.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Subcommand;
use serde::Serialize;

mod exchange;

use super::policies::{self, PolicyArgs, Waters};
use super::table::table;
use crate::episode::{Compliance, Episode, TargetEncounter, TargetSummary};
use crate::geo::M_PER_NMI;
use crate::report::{self, EpisodeFiles};
use crate::scenario::{ForecasterChoice, Scenario, ScenarioFile, StagedEncounter};

/// The scenario commands.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// List the scenarios of a directory
    List {
        /// Directory of scenario files, searched with its subdirectories
        #[arg(default_value = "scenarios")]
        directory: PathBuf,
    },
    /// Check scenario files: keys, units, geometry, and that recorded tracks are there
    Check {
        /// Scenario files
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Run a scenario; print what came of it and write a replay
    #[command(after_help = "Examples:\n  \
        searoom scenario run scenarios/head_on.toml\n  \
        searoom scenario run scenarios/head_on.toml --policy rule-based --out out/rule-based\n  \
        searoom scenario run scenarios/head_on.toml --policy runs/coastal-lstm-sac-seed-1\n  \
        searoom scenario run scenarios/head_on_curve.toml --seed 7 --json\n  \
        searoom scenario run scenarios/head_on_curve.toml \\\n    \
        --policy mpc --forecaster models/coastal-ny-lower-bay.safetensors")]
    Run(RunArgs),
    /// Make a scenario file of a traffic situation in DNV's maritime-schema JSON
    #[command(after_help = "What a scenario cannot hold is left out and listed.\n\nExamples:\n  \
        searoom scenario import situation.json --out situation.toml\n  \
        searoom scenario import situation.json --out situation.toml --dynamics kvlcc2")]
    Import(exchange::ImportArgs),
    /// Write a scenario as a traffic situation in DNV's maritime-schema JSON
    #[command(after_help = "Examples:\n  \
        searoom scenario export scenarios/fairway.toml --out fairway.json\n  \
        searoom scenario export scenarios/tankers.toml --out tankers.json \\\n    \
        --origin-latitude-deg 54.1 --origin-longitude-deg 7.9")]
    Export(exchange::ExportArgs),
}

#[derive(Debug, clap::Args)]
struct RunArgs {
    /// Scenario file
    file: PathBuf,
    /// Who steers own ship, instead of the policy the file names: hold-course, full-starboard, full-port, rule-based,
    /// velocity-obstacle, potential-field, mpc, the folder of a run or the file of an agent
    #[arg(long)]
    policy: Option<String>,
    /// What forecasts the target ships for the policy: "linear", or the weights of a trained forecaster;
    /// without it, and where the file names none, their velocities are extrapolated
    #[arg(long, value_name = "linear|FILE")]
    forecaster: Option<String>,
    #[command(flatten)]
    settings: PolicyArgs,
    /// Seed of everything random, instead of the file's
    #[arg(long)]
    seed: Option<u64>,
    /// Directory for episode.csv, episode.jsonl and index.html [default: out/NAME]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print the outcome as JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Files that cannot be read or written, scenarios that cannot be.
pub fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::List { directory } => list(&directory, out),
        Command::Check { files } => check(&files, out),
        Command::Run(args) => run_scenario(&args, out),
        Command::Import(args) => exchange::run_import(&args, out),
        Command::Export(args) => exchange::run_export(&args, out),
    }
}

fn list(directory: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    let files = scenario_files(directory).with_context(|| {
        format!("{}: cannot be listed; name a directory of scenarios", directory.display())
    })?;
    if files.is_empty() {
        bail!("{}: holds no scenario files (*.toml); name another directory", directory.display());
    }
    let mut rows = table(2, &["file", "title", "targets", "duration"]);
    for file in files {
        match ScenarioFile::load(&file) {
            Ok(ScenarioFile { scenario, .. }) => rows.add_row([
                file.display().to_string(),
                scenario.title,
                scenario.targets.len().to_string(),
                format!("{} s", scenario.duration_s),
            ]),
            Err(error) => rows.add_row([file.display().to_string(), format!("cannot be read: {error}")]),
        };
    }
    writeln!(out, "{rows}")?;
    Ok(())
}

/// The TOML files under a directory, sorted by path.
fn scenario_files(directory: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(scenario_files(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "toml") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn check(files: &[PathBuf], out: &mut dyn Write) -> anyhow::Result<()> {
    let mut faulty = 0;
    for file in files {
        match ScenarioFile::load(file).and_then(|scenario| scenario.set_up()) {
            Ok(staged) => writeln!(out, "{}: {}", file.display(), described(&staged))?,
            Err(error) => {
                faulty += 1;
                writeln!(out, "{error}")?;
            }
        }
    }
    match faulty {
        0 => Ok(()),
        1 => bail!("one scenario cannot be used, see above"),
        _ => bail!("{faulty} scenarios cannot be used, see above"),
    }
}

/// The staged at the start in a line.
fn described(staged: &StagedEncounter) -> String {
    let targets = staged
        .targets
        .iter()
        .map(|target| {
            let range_m = target.motion.position(0).distance_m(staged.own_start.position);
            format!("{} {:.2} nmi off", target.name, range_m / M_PER_NMI)
        })
        .collect::<Vec<_>>();
    let steps = staged.scenario.steps();
    if targets.is_empty() {
        format!("fits, {steps} steps, no targets")
    } else {
        format!("fits, {steps} steps, {}", targets.join(", "))
    }
}

fn run_scenario(args: &RunArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let mut file = ScenarioFile::load(&args.file)?;
    if let Some(word) = &args.forecaster {
        file.scenario.forecaster = Some(ForecasterChoice::of(word, Path::new("")));
    }
    if let Some(seed) = args.seed {
        file.scenario.seed = seed;
    }
    let staged = file.set_up()?;
    let name = args.policy.as_deref().unwrap_or(&staged.scenario.policy);
    let waters = Waters { decision_s: staged.decision_s(), origin: staged.plane.map(|plane| plane.origin) };
    let (mut policy, remark) = policies::open(name, &waters, &args.settings.load()?)?;
    if let Some(remark) = remark {
        eprintln!("note: {remark}");
    }
    let episode = staged.run_under(policy.as_mut());
    let directory = args.out.clone().unwrap_or_else(|| Path::new("out").join(&file.scenario.name));
    let files = report::write_episode(&episode, &directory)?;
    let outcome = Outcome::of(&episode, &file.scenario, files);
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&outcome)?)?;
    } else {
        outcome.print(&file.scenario.title, out)?;
    }
    Ok(())
}

/// What came of a run, as `--json` prints it.
#[derive(Debug, Serialize)]
struct Outcome {
    scenario: String,
    policy: String,
    /// What forecast the target ships; nothing where their velocities were extrapolated.
    forecaster: Option<String>,
    seed: u64,
    duration_s: f64,
    contact: bool,
    targets: Vec<TargetOutcome>,
    /// How own ship kept to the collision regulations.
    compliance: Compliance,
    files: Files,
}

#[derive(Debug, Serialize)]
struct TargetOutcome {
    name: String,
    dcpa_at_start_m: f64,
    tcpa_at_start_s: f64,
    closest_m: f64,
    closest_at_s: f64,
    closest_hulls_m: f64,
    contact_distance_m: f64,
    circle_contacts: usize,
    first_circle_contact_s: Option<f64>,
    first_hull_contact_s: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Files {
    csv: PathBuf,
    jsonl: PathBuf,
    html: PathBuf,
}

impl Outcome {
    fn of(episode: &Episode, scenario: &Scenario, files: EpisodeFiles) -> Self {
        Self {
            scenario: episode.scenario.clone(),
            policy: episode.policy.clone(),
            forecaster: scenario.forecaster.as_ref().map(ToString::to_string),
            seed: episode.seed,
            duration_s: episode.duration_s(),
            contact: episode.has_contact(),
            targets: episode.summaries().into_iter().map(TargetOutcome::from).collect(),
            compliance: episode.compliance(&scenario.rules.encounters, &scenario.rules.compliance),
            files: Files { csv: files.csv, jsonl: files.jsonl, html: files.html },
        }
    }

    fn print(&self, title: &str, out: &mut dyn Write) -> anyhow::Result<()> {
        writeln!(out, "{title}")?;
        let forecaster =
            self.forecaster.as_ref().map_or_else(String::new, |name| format!(", forecasts: {name}"));
        writeln!(out, "{}{forecaster}, seed {}, {:.0} s", self.policy, self.seed, self.duration_s)?;
        let headings =
            ["target", "DCPA at start", "TCPA at start", "closest", "at", "hulls", "contact of circles"];
        let mut rows = table(1, &headings);
        for target in &self.targets {
            rows.add_row([
                target.name.clone(),
                format!("{:.0} m", target.dcpa_at_start_m),
                format!("{:.0} s", target.tcpa_at_start_s),
                format!("{:.0} m", target.closest_m),
                format!("{:.0} s", target.closest_at_s),
                format!("{:.0} m", target.closest_hulls_m),
                target.contact(),
            ]);
        }
        writeln!(out, "{rows}")?;
        self.print_compliance(out)?;
        writeln!(out, "Wrote {} and {}", self.files.csv.display(), self.files.jsonl.display())?;
        writeln!(out, "Open {} in a browser to replay it", self.files.html.display())?;
        Ok(())
    }
}

impl Outcome {
    fn print_compliance(&self, out: &mut dyn Write) -> anyhow::Result<()> {
        let Some(score) = self.compliance.score else { return Ok(()) };
        let headings = [
            "encounter",
            "role",
            "from",
            "until",
            "action",
            "distance",
            "turn side",
            "passing side",
            "early",
            "substantial",
            "stand-on",
            "score",
        ];
        let mut rows = table(2, &headings);
        for TargetEncounter { target, report } in &self.compliance.encounters {
            let part = |part: Option<f64>| part.map_or_else(|| "-".to_owned(), |part| format!("{part:.2}"));
            let parts = &report.parts;
            rows.add_row([
                format!("{target}: {}", report.encounter.words()),
                report.role.words().to_owned(),
                format!("{:.0} s", report.begin_s),
                format!("{:.0} s", report.end_s),
                report.action_s.map_or_else(|| "none".to_owned(), |time_s| format!("{time_s:.0} s")),
                part(Some(parts.passing_distance)),
                part(parts.turn_side),
                part(parts.passing_side),
                part(parts.early),
                part(parts.substantial),
                part(parts.stand_on),
                part(Some(report.score)),
            ]);
        }
        writeln!(out, "{rows}")?;
        writeln!(out, "Compliance with the collision regulations: {score:.2} of 1 (docs/encounters.md)")?;
        Ok(())
    }
}

impl TargetOutcome {
    fn contact(&self) -> String {
        match (self.first_hull_contact_s, self.first_circle_contact_s) {
            (Some(hulls_s), _) => format!("hulls collide at {hulls_s:.0} s"),
            (None, Some(circles_s)) => format!("from {circles_s:.0} s"),
            (None, None) => format!("none within {:.0} m", self.contact_distance_m),
        }
    }
}

impl From<TargetSummary> for TargetOutcome {
    fn from(summary: TargetSummary) -> Self {
        Self {
            name: summary.name,
            dcpa_at_start_m: summary.start_cpa.distance_m,
            tcpa_at_start_s: summary.start_cpa.time_s,
            closest_m: summary.closest_centre_m,
            closest_at_s: summary.closest_centre_time_s,
            closest_hulls_m: summary.closest_hull_m,
            contact_distance_m: summary.contact_distance_m,
            circle_contacts: summary.circle_contacts,
            first_circle_contact_s: summary.first_circle_contact_s,
            first_hull_contact_s: summary.first_hull_contact_s,
        }
    }
}
