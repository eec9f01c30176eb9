//! `searoom benchmark noise`: the paper's test of robustness, over trained agents and classical policies.

use std::io::Write;
use std::path::PathBuf;

use anyhow::bail;
use clap::{Args as ClapArgs, ValueEnum};
use rayon::ThreadPoolBuilder;

use super::super::policies::RulesArgs;
use super::super::progress;
use crate::env::coastal::ScenarioChoice;
use crate::experiment::noise::{
    Cell, Estimates, Foresight, Group, NoiseConfig, ThinnedPath, TracksPart, Waters, forecast, rows,
};

mod field;
mod files;
mod forecasters;
mod ledger;
mod recordings;
mod tables;

use field::Field;
use ledger::Ledger;
use recordings::Recordings;

/// Options of `searoom benchmark noise`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom benchmark noise
  searoom benchmark noise --policies runs/mine hold-course rule-based --sigma-m 0,20 --episodes 500
  searoom benchmark noise --area ais/hampton-roads.toml --ais ais/hampton-roads-2020-06.csv.gz
  searoom benchmark noise --json > noise.json

Everyone sails the same seeded head-on encounters with recorded vessels: before a curve, where the vessel is about
to turn away and a turn to starboard meets it, and straight on, where holding course meets it. Contact is a centre
distance of 300 m at any time. Sensor noise has the stated standard deviation on north and on east, for every vessel and
time step. Encounters are those of the held-out time, which neither forecasters nor agents have seen; beside them stand
those with vessels unknown to training, and as many from the training time.

A row \"(true future)\" gives an agent estimates from what will happen: it tells errors of the forecast from errors of
the policy. An interrupted benchmark goes on where it was when the same command is given again.")]
pub struct Args {
    /// Who takes part: run folders, files of agents, names of classical policies [default: the shipped agents, best
    /// seed of each kind, and all classical policies]
    #[arg(long, num_args = 1.., value_name = "PATH|NAME")]
    policies: Vec<PathBuf>,
    /// Every seed of the shipped agents, not only the best of each kind by its evaluation in training
    #[arg(long, conflicts_with = "policies")]
    all_seeds: bool,
    /// Standard deviations of the sensor noise, in metres
    #[arg(long, value_delimiter = ',', default_value = "0,5,10,20")]
    sigma_m: Vec<f64>,
    /// Episodes of each scenario and noise
    #[arg(long, default_value_t = 100)]
    episodes: usize,
    /// Which encounters
    #[arg(long, value_enum, default_value_t = Scenario::Both)]
    scenario: Scenario,
    /// Seed of the episodes
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Another area (TOML), all of its tracks; needs --ais
    #[arg(long, requires = "ais", conflicts_with = "tracks")]
    area: Option<PathBuf>,
    /// AIS files of that area
    #[arg(long, num_args = 1.., requires = "area")]
    ais: Vec<PathBuf>,
    /// Tracks that `searoom ais import` wrote, all of them
    #[arg(long, value_name = "DIR")]
    tracks: Option<PathBuf>,
    /// With --area or --tracks: the part of the time span that training has seen; the rest is sailed
    #[arg(long, value_name = "FRACTION")]
    train_fraction: Option<f64>,
    /// Leave out the episodes from the training time
    #[arg(long)]
    no_training_tracks: bool,
    /// Weights of the forecaster for classical policies
    #[arg(long, default_value = forecasters::SHIPPED)]
    forecaster: PathBuf,
    #[command(flatten)]
    rules: RulesArgs,
    /// Threads to compute on; the result is the same for any number [default: all]
    #[arg(long)]
    threads: Option<usize>,
    /// Folder for the page of replays, the figure, tables as CSV and JSON
    #[arg(long, default_value = "out/noise")]
    out: PathBuf,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// The scenarios on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Scenario {
    /// Either.
    Both,
    /// The vessel is about to turn to port and clear (the paper's scenario 1).
    #[value(alias = "1")]
    BeforeCurve,
    /// The vessel goes straight on (the paper's scenario 2).
    #[value(alias = "2")]
    StraightOn,
}

impl Scenario {
    fn choice(self) -> ScenarioChoice {
        match self {
            Self::Both => ScenarioChoice::Both,
            Self::BeforeCurve => ScenarioChoice::BeforeCurve,
            Self::StraightOn => ScenarioChoice::StraightOn,
        }
    }
}

impl Args {
    fn config(&self) -> anyhow::Result<NoiseConfig> {
        if self.episodes == 0 {
            bail!("--episodes is 0: give 1 or more");
        }
        if let Some(sigma_m) = self.sigma_m.iter().find(|sigma_m| !(sigma_m.is_finite() && **sigma_m >= 0.0))
        {
            bail!("--sigma-m has {sigma_m}: standard deviations are metres, 0 or more");
        }
        let mut sigmas_m = self.sigma_m.clone();
        sigmas_m.sort_by(f64::total_cmp);
        sigmas_m.dedup();
        Ok(NoiseConfig {
            sigmas_m,
            scenario: self.scenario.choice(),
            episodes: self.episodes,
            seed: self.seed,
            rules: self.rules.load()?,
            ..NoiseConfig::default()
        })
    }
}

pub(super) fn run(args: &Args, out: &mut dyn Write) -> anyhow::Result<()> {
    let config = args.config()?;
    let pool = ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0)).build()?;
    let benchmark = Benchmark::load(args, config, &pool)?;
    let cells = pool.install(|| benchmark.sail())?;
    let rows = rows(&cells.cells, &benchmark.field.contestants, &benchmark.recordings.waters);
    let files = pool.install(|| files::write(&benchmark, &cells, &rows, &args.out))?;
    benchmark.ledger.remove()?;
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&rows)?)?;
        return Ok(());
    }
    tables::write(&benchmark, &rows, out)?;
    Ok(files.tell(out)?)
}

/// Everything that is sailed, and by whom.
struct Benchmark {
    config: NoiseConfig,
    recordings: Recordings,
    field: Field,
    ledger: Ledger,
}

/// What came of it.
#[derive(Default)]
struct Results {
    cells: Vec<Cell>,
    /// Forecasts for replays, one list per group in the order of [`Benchmark::groups`]; of the shipped or the named
    /// forecaster.
    paths: Vec<Vec<ThinnedPath>>,
}

impl Benchmark {
    fn load(args: &Args, config: NoiseConfig, pool: &rayon::ThreadPool) -> anyhow::Result<Self> {
        let field = Field::load(args, &config.coastal)?;
        let recordings = pool.install(|| Recordings::load(args, &config))?;
        for warning in field.warnings(&recordings) {
            eprintln!("note: {warning}");
        }
        let ledger = Ledger::open(&args.out, &config, &recordings, &field)?;
        Ok(Self { config, recordings, field, ledger })
    }

    fn groups(&self) -> Vec<Group<'_>> {
        self.recordings.waters.iter().flat_map(|waters| self.config.groups(waters)).collect()
    }

    /// Sails what the ledger does not hold yet, group by group.
    fn sail(&self) -> anyhow::Result<Results> {
        let groups = self.groups();
        let plans = groups.iter().map(|group| self.plan(group)).collect::<Vec<_>>();
        let bar = progress::steps(plans.iter().map(|plan| plan.work).sum(), "loading");
        let mut results = Results::default();
        for (group, plan) in groups.iter().zip(plans) {
            let mut cells: Vec<Option<Cell>> = plan.cells;
            bar.set_message(group_label(group));
            let mut foresight = Foresight::default();
            let mut thinned = plan.paths;
            for &forecaster in &plan.forecasters {
                let make = || self.field.forecasters.make(forecaster);
                let paths = forecast(group, &self.config, &make, &|done| bar.inc(done as u64))?;
                if forecaster == 0 {
                    thinned = Some(paths.iter().map(ThinnedPath::of).collect());
                }
                foresight.add(forecaster, paths.into_iter().collect());
            }
            let thinned = thinned.unwrap_or_default();
            self.ledger.save_paths(group, &thinned)?;
            for (contestant, cell) in self.field.contestants.iter().zip(&mut cells) {
                if cell.is_none() {
                    let sailed = group.sail(&self.config, contestant, &foresight, &|| bar.inc(1))?;
                    self.ledger.save(group, self.field.fingerprint(contestant), &sailed)?;
                    *cell = Some(sailed);
                }
            }
            results.cells.extend(cells.into_iter().flatten());
            results.paths.push(thinned);
        }
        bar.finish_and_clear();
        Ok(results)
    }

    /// What is left to do in a group.
    fn plan(&self, group: &Group<'_>) -> Plan {
        let cells: Vec<Option<Cell>> = self
            .field
            .contestants
            .iter()
            .map(|contestant| self.ledger.cell(group, &contestant.name, self.field.fingerprint(contestant)))
            .collect();
        let paths = self.ledger.paths(group);
        let missing = self.field.contestants.iter().zip(&cells).filter(|(_, cell)| cell.is_none());
        let mut forecasters: Vec<usize> = missing
            .filter_map(|(contestant, _)| match contestant.estimates {
                Estimates::Forecast(forecaster) => Some(forecaster),
                Estimates::None | Estimates::Truth => None,
            })
            .collect();
        if paths.is_none() && self.field.forecasters.is_used(0) {
            forecasters.push(0);
        }
        forecasters.sort_unstable();
        forecasters.dedup();
        let voyages = cells.iter().filter(|cell| cell.is_none()).count() * self.config.episodes;
        let coastal = &self.config.coastal;
        let moments = 1 + coastal.decisions / coastal.forecast_every_decisions.max(1);
        let work = (voyages + forecasters.len() * moments * self.config.episodes) as u64;
        Plan { cells, paths, forecasters, work }
    }
}

/// What is left to do in a group.
struct Plan {
    /// What the ledger holds, one per contestant.
    cells: Vec<Option<Cell>>,
    paths: Option<Vec<ThinnedPath>>,
    /// Forecasters that are needed.
    forecasters: Vec<usize>,
    /// Episodes to sail and histories to forecast.
    work: u64,
}

fn group_label(group: &Group<'_>) -> String {
    let part = match group.waters.part {
        TracksPart::Training => "training, ",
        TracksPart::HeldOut | TracksPart::Whole => "",
    };
    format!("{part}{} {} m", crate::experiment::noise::scenario_name(group.kind), group.sigma_m)
}

/// The waters that results are about, and those that stand beside them.
fn main_waters(waters: &[Waters]) -> Option<&Waters> {
    waters.iter().find(|waters| waters.part != TracksPart::Training)
}
