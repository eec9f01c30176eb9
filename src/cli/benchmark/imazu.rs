//! `searoom benchmark imazu`: every Imazu problem under every policy.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use rayon::prelude::*;
use serde::Serialize;

use crate::atomic_file;
use crate::cli::policies::{self, PolicyArgs, RulesArgs, Waters};
use crate::cli::progress;
use crate::cli::table::table;
use crate::encounter::RulesConfig;
use crate::episode::Episode;
use crate::policy::{NAMES, Policy, PolicyConfigs};
use crate::report::pictures::{Picture, PicturePage};
use crate::scenario::StagedEncounter;
use crate::scenario::imazu::ImazuProblems;

/// Options of `searoom benchmark imazu`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  searoom benchmark imazu
  searoom benchmark imazu --policies velocity-obstacle mpc --out out/imazu
  searoom benchmark imazu --cases 1,5,14 --json
  searoom benchmark imazu --policies rule-based runs/coastal-lstm-sac-seed-1
  searoom scenario run scenarios/imazu/14.toml --policy mpc      one of them, to be replayed

All ships of a case would meet in one point after 30 minutes; no target ship gives way. The pictures are in
index.html under --out. docs/encounters.md tells what the columns mean.")]
pub struct Args {
    /// Who steers own ship: names of classical policies, run folders, files of agents, with blanks or commas between;
    /// all classical ones where not given
    #[arg(long, num_args = 1.., value_delimiter = ',', value_name = "NAME|PATH", default_values = NAMES)]
    policies: Vec<String>,
    /// Numbers of the problems; all of them where not given
    #[arg(long, value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=22))]
    cases: Vec<u32>,
    #[command(flatten)]
    settings: PolicyArgs,
    #[command(flatten)]
    rules: RulesArgs,
    /// Directory for index.html and imazu.svg with a picture of every episode, and imazu.json
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
    /// Threads; all cores where not given. The result does not depend on it
    #[arg(long)]
    threads: Option<usize>,
    /// Write the problems as scenario files into this directory, and run nothing
    #[arg(long, value_name = "DIR")]
    write_scenarios: Option<PathBuf>,
}

/// What came of one problem under one policy.
#[derive(Debug, Clone, Serialize)]
struct Outcome {
    case: u32,
    policy: String,
    /// Whether collision circles touched.
    contact: bool,
    /// Smallest distance of centres to any target ship.
    closest_m: f64,
    /// Mean score under the collision regulations, 0 to 1.
    compliance: Option<f64>,
    /// Largest distance from the route to either side.
    largest_cross_track_m: f64,
    /// How far own ship came along its route, of what its speed would have given.
    progress: f64,
}

/// What came of all problems under one policy.
#[derive(Debug, Clone, Serialize)]
struct PolicyOutcome {
    policy: String,
    cases: usize,
    contacts: usize,
    mean_compliance: Option<f64>,
    mean_largest_cross_track_m: f64,
    mean_progress: f64,
}

#[derive(Debug, Serialize)]
struct Results {
    policies: Vec<PolicyOutcome>,
    episodes: Vec<Outcome>,
}

/// Runs the command.
pub(super) fn run(args: &Args, out: &mut dyn Write) -> anyhow::Result<()> {
    let problems = ImazuProblems::shipped();
    if let Some(directory) = &args.write_scenarios {
        for number in problems.numbers() {
            let file = directory.join(ImazuProblems::file_name(number));
            atomic_file::write(&file, |out| out.write_all(problems.scenario_text(number).as_bytes()))?;
        }
        writeln!(out, "Wrote {} scenarios to {}", problems.numbers().count(), directory.display())?;
        return Ok(());
    }
    let configs = args.settings.load()?;
    let cases: Vec<u32> =
        problems.numbers().filter(|number| args.cases.is_empty() || args.cases.contains(number)).collect();
    let staged = cases
        .iter()
        .map(|&number| Ok((number, problems.scenario(number)?.set_up()?)))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let rules = args.rules.load()?;
    let names = names(&staged, &args.policies, &configs)?;
    let bench = Bench { staged: &staged, policies: &args.policies, configs: &configs, rules };
    let episodes = bench.run_all(args.threads)?;
    let outcomes: Vec<Outcome> = episodes.iter().map(|(outcome, _)| outcome.clone()).collect();
    let results = Results { policies: summarise(&names, &outcomes), episodes: outcomes };
    if let Some(directory) = &args.out {
        let json = serde_json::to_string_pretty(&results)?;
        atomic_file::write(&directory.join("imazu.json"), |out| out.write_all(json.as_bytes()))?;
        let page = pictures(&problems, &cases, &names, &episodes);
        page.write(&directory.join("index.html"))?;
        page.write_figure(&directory.join("imazu.svg"))?;
    }
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&results)?)?;
        return Ok(());
    }
    print(&results, &cases, &names, out)?;
    if let Some(directory) = &args.out {
        writeln!(out, "Open {} in a browser for the pictures", directory.join("index.html").display())?;
    }
    Ok(())
}

/// What policies are called in tables; remarks on how they are used go to the terminal.
fn names(
    staged: &[(u32, StagedEncounter)],
    policies: &[String],
    configs: &PolicyConfigs,
) -> anyhow::Result<Vec<String>> {
    let mut names: Vec<String> = Vec::with_capacity(policies.len());
    let Some((_, encounter)) = staged.first() else { return Ok(policies.to_vec()) };
    for word in policies {
        let (policy, remark) = open(word, encounter, configs)?;
        if names.iter().any(|name| name == policy.name()) {
            bail!(
                "--policies has two called \"{}\": give each file or folder a name of its own",
                policy.name()
            );
        }
        names.push(policy.name().to_owned());
        if let Some(remark) = remark {
            eprintln!("note: {remark}");
        }
    }
    Ok(names)
}

fn open(
    word: &str,
    encounter: &StagedEncounter,
    configs: &PolicyConfigs,
) -> anyhow::Result<(Box<dyn Policy>, Option<String>)> {
    let origin = encounter.plane.map(|plane| plane.origin);
    policies::open(word, &Waters { decision_s: encounter.decision_s(), origin }, configs)
}

/// What is run.
struct Bench<'a> {
    staged: &'a [(u32, StagedEncounter)],
    policies: &'a [String],
    configs: &'a PolicyConfigs,
    rules: RulesConfig,
}

impl Bench<'_> {
    /// Every case under every policy, case by case.
    fn run_all(&self, threads: Option<usize>) -> anyhow::Result<Vec<(Outcome, Picture)>> {
        ensure!(threads != Some(0), "--threads is 0: name 1 or more, or leave it out");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
        let pool = pool.context("the threads cannot be started; try --threads 1")?;
        let jobs: Vec<_> =
            self.staged.iter().flat_map(|case| self.policies.iter().map(move |word| (case, word))).collect();
        let bar = progress::steps(jobs.len() as u64, "episodes");
        let run = |((number, encounter), word): &(&(u32, StagedEncounter), &String)| {
            let (mut policy, _) = open(word, encounter, self.configs)?;
            let episode = encounter.run_under(policy.as_mut());
            bar.inc(1);
            Ok((outcome(*number, encounter, &episode, &self.rules), Picture::of(&episode)))
        };
        let episodes = pool.install(|| jobs.par_iter().map(run).collect());
        bar.finish_and_clear();
        episodes
    }
}

fn outcome(case: u32, encounter: &StagedEncounter, episode: &Episode, rules: &RulesConfig) -> Outcome {
    let own = || episode.steps.iter().map(|step| step.vessels[0].position);
    let cross_track = own().map(|position| encounter.route.cross_track_error_m(position).abs());
    let start = encounter.own_start;
    let made_m = own().next_back().map_or(0.0, |end| (end - start.position).along_m(start.velocity.course()));
    let summaries = episode.summaries();
    let compliance = episode.compliance(&rules.encounters, &rules.compliance);
    Outcome {
        case,
        policy: episode.policy.clone(),
        contact: episode.has_contact(),
        closest_m: summaries.iter().map(|target| target.closest_centre_m).fold(f64::INFINITY, f64::min),
        compliance: compliance.score,
        largest_cross_track_m: cross_track.fold(0.0, f64::max),
        progress: made_m / (start.velocity.speed_mps() * episode.duration_s()),
    }
}

fn summarise(policies: &[String], outcomes: &[Outcome]) -> Vec<PolicyOutcome> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    policies
        .iter()
        .map(|policy| {
            let of: Vec<_> = outcomes.iter().filter(|outcome| outcome.policy == *policy).collect();
            let all =
                |value: fn(&Outcome) -> f64| of.iter().map(|outcome| value(outcome)).collect::<Vec<_>>();
            let scores: Vec<f64> = of.iter().filter_map(|outcome| outcome.compliance).collect();
            PolicyOutcome {
                policy: policy.clone(),
                cases: of.len(),
                contacts: of.iter().filter(|outcome| outcome.contact).count(),
                mean_compliance: (!scores.is_empty()).then(|| mean(&scores)),
                mean_largest_cross_track_m: mean(&all(|outcome| outcome.largest_cross_track_m)),
                mean_progress: mean(&all(|outcome| outcome.progress)),
            }
        })
        .collect()
}

/// Distance and score of an episode, as the table and the pictures have them.
fn cell(outcome: &Outcome) -> String {
    let mark = if outcome.contact { " contact" } else { "" };
    let score = outcome.compliance.map_or_else(|| "-".to_owned(), |score| format!("{score:.2}"));
    format!("{:.0} m{mark}, {score}", outcome.closest_m)
}

fn print(results: &Results, cases: &[u32], policies: &[String], out: &mut dyn Write) -> anyhow::Result<()> {
    writeln!(out, "Closest distance of centres, and compliance with the collision regulations (0 to 1)")?;
    let headings: Vec<&str> = std::iter::once("case").chain(policies.iter().map(String::as_str)).collect();
    let mut rows = table(1, &headings);
    for (case, outcomes) in cases.iter().zip(results.episodes.chunks(policies.len())) {
        rows.add_row(std::iter::once(case.to_string()).chain(outcomes.iter().map(cell)));
    }
    writeln!(out, "{rows}\n")?;
    let headings = ["policy", "cases", "contacts", "compliance", "largest cross-track error", "progress"];
    let mut rows = table(1, &headings);
    for policy in &results.policies {
        rows.add_row([
            policy.policy.clone(),
            policy.cases.to_string(),
            policy.contacts.to_string(),
            policy.mean_compliance.map_or_else(|| "-".to_owned(), |score| format!("{score:.2}")),
            format!("{:.0} m", policy.mean_largest_cross_track_m),
            format!("{:.1} %", 100.0 * policy.mean_progress),
        ]);
    }
    writeln!(out, "{rows}")?;
    Ok(())
}

fn pictures(
    problems: &ImazuProblems,
    cases: &[u32],
    policies: &[String],
    episodes: &[(Outcome, Picture)],
) -> PicturePage {
    let row = |(case, episodes): (&u32, &[(Outcome, Picture)])| {
        let kinds = problems.encounters(*case);
        let words: Vec<_> =
            kinds.into_iter().map(|kind| kind.map_or("no encounter", |kind| kind.words())).collect();
        let cells = episodes.iter().map(|(outcome, picture)| (picture.clone(), cell(outcome))).collect();
        (format!("{case}: {}", words.join(", ")), cells)
    };
    PicturePage {
        title: "The 22 Imazu problems".to_owned(),
        note: "All ships of a case would meet in one point after 30 minutes, and no target ship gives way. Own ship \
               is blue; dots mark the start, rings where own ship and the nearest target ship were closest, red if \
               their collision circles touched. Under each picture: closest distance of centres, and compliance with \
               the collision regulations from 0 to 1. Replay one with `searoom scenario run scenarios/imazu/NN.toml \
               --policy NAME`."
            .to_owned(),
        columns: policies.to_vec(),
        rows: cases.iter().zip(episodes.chunks(policies.len())).map(row).collect(),
    }
}
