//! `searoom evaluate`: how a trained agent does on episodes that it never saw, beside agents that know nothing.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use rayon::ThreadPoolBuilder;

use super::agent_run::{EnvMaker, TracksPart};
use super::progress;
use crate::agent::{RunConfig, TrainedAgent};
use crate::env::{Env, EnvName, SeedDomain};
use crate::nn::Compute;
use crate::rl::rollout::{AgentBatch, BatchPolicy, NoAction, RolledEpisode, Rollout, UniformActions};

mod report;

use report::{Comparison, EpisodeResult, Report};

/// Options of `searoom evaluate`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom evaluate runs/periodic
  searoom evaluate runs/coastal --episodes 500 --noise-m 10
  searoom evaluate runs/coastal --tracks training --json

Actions are deterministic and the weights are those with the best evaluation during training. The seeds are
those of benchmarks: neither training nor its evaluations ever use them. Coastal encounters are those of the held-out
time, unless --tracks says otherwise.

Beside the agent, two references sail the same episodes: hold-course never acts, random draws every action uniformly. The
line below the table compares the agent with the better of them. Intervals are 95 %: Wilson's for shares of episodes,
Student's t for means, a bootstrap over episodes for the ratio.")]
pub struct Args {
    /// Folder of the run, or the file of an agent.
    run: PathBuf,
    /// Episodes to run.
    #[arg(long, default_value_t = 100)]
    episodes: u64,
    /// Standard deviation of the sensor noise on north and on east, in metres (coastal); without it, the run's own.
    #[arg(long)]
    noise_m: Option<f64>,
    /// Which recorded time the encounters are from (coastal).
    #[arg(long, value_enum, default_value_t = TracksPart::HeldOut)]
    tracks: TracksPart,
    /// Leave the references out.
    #[arg(long)]
    no_references: bool,
    /// Threads to compute on; the result is the same for any number.
    #[arg(long, default_value_t = default_threads())]
    threads: usize,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

fn default_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Environments side by side. The result does not depend on it; more of them take more memory.
const COPIES: u64 = 32;

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    if args.episodes < 2 {
        bail!("--episodes is {}: an interval needs two or more", args.episodes);
    }
    let mut agent = TrainedAgent::open(&args.run)?;
    set_noise(&args, &mut agent.config)?;
    let config = &agent.config;
    let pool = ThreadPoolBuilder::new().num_threads(args.threads).build()?;
    let envs = EnvMaker::new(config, args.tracks)?;
    let evaluator = Evaluator { args: &args, config, envs: &envs };
    let agent_results = pool.install(|| evaluator.run_agent(&agent))?;
    let mut policies = vec![(agent.name.clone(), agent_results)];
    if !args.no_references {
        for reference in [Reference::HoldCourse, Reference::Random] {
            let results = pool.install(|| evaluator.run_reference(reference))?;
            policies.push((reference.name().to_owned(), results));
        }
    }
    let report = Report {
        run: args.run.clone(),
        env: config.env,
        episodes: args.episodes,
        noise_m: (config.env == EnvName::Coastal).then_some(config.coastal.noise_m),
        tracks: (config.env == EnvName::Coastal).then_some(args.tracks),
        rows: policies.iter().flat_map(|(name, results)| report::rows(name, results)).collect(),
        comparison: Comparison::with_better_reference(&policies),
    };
    if args.json {
        writeln!(out, "{}", serde_json::to_string(&report)?)?;
        return Ok(());
    }
    report.print(out)
}

/// Sets the noise that is asked for.
fn set_noise(args: &Args, config: &mut RunConfig) -> anyhow::Result<()> {
    let Some(noise_m) = args.noise_m else { return Ok(()) };
    if config.env != EnvName::Coastal {
        bail!("--noise-m is {noise_m}, but {} is no coastal run: leave it out", args.run.display());
    }
    if !(noise_m.is_finite() && noise_m >= 0.0) {
        bail!("--noise-m is {noise_m}: give a standard deviation of 0 or more metres");
    }
    config.coastal.noise_m = noise_m;
    Ok(())
}

/// An agent that knows nothing.
#[derive(Debug, Clone, Copy)]
enum Reference {
    HoldCourse,
    Random,
}

impl Reference {
    fn name(self) -> &'static str {
        match self {
            Self::HoldCourse => "hold-course",
            Self::Random => "random",
        }
    }

    fn batch(self, rows: usize) -> Box<dyn BatchPolicy> {
        match self {
            Self::HoldCourse => Box::new(NoAction),
            Self::Random => Box::new(UniformActions::new(rows)),
        }
    }
}

struct Evaluator<'a> {
    args: &'a Args,
    config: &'a RunConfig,
    envs: &'a EnvMaker,
}

impl Evaluator<'_> {
    fn run_agent(&self, agent: &TrainedAgent) -> anyhow::Result<Vec<EpisodeResult>> {
        let batch = |rows| -> Box<dyn BatchPolicy> {
            Box::new(AgentBatch::new(&agent.agent, rows, Compute::new(self.args.threads)))
        };
        self.run_episodes(self.envs, &batch, "the agent")
    }

    /// The same episodes. A reference looks at nothing, so that no estimates are made for it.
    fn run_reference(&self, reference: Reference) -> anyhow::Result<Vec<EpisodeResult>> {
        self.run_episodes(&self.envs.without_estimates(), &|rows| reference.batch(rows), reference.name())
    }

    fn run_episodes(
        &self,
        envs: &EnvMaker,
        policy: &dyn Fn(usize) -> Box<dyn BatchPolicy>,
        who: &str,
    ) -> anyhow::Result<Vec<EpisodeResult>> {
        let rows = self.args.episodes.min(COPIES) as usize;
        let mut policy = policy(rows);
        match self.config.env {
            EnvName::OpenWater => {
                let copies = (0..rows).map(|_| envs.open_water()).collect::<Result<Vec<_>, _>>()?;
                self.roll_out(copies, policy.as_mut(), who, |_| None)
            }
            EnvName::Coastal => {
                let copies = (0..rows).map(|_| envs.coastal()).collect::<Result<Vec<_>, _>>()?;
                self.roll_out(copies, policy.as_mut(), who, |env| env.outcome())
            }
        }
    }

    fn roll_out<E: Env>(
        &self,
        copies: Vec<E>,
        policy: &mut dyn BatchPolicy,
        who: &str,
        outcome: impl Fn(&E) -> Option<crate::env::coastal::Outcome> + Sync,
    ) -> anyhow::Result<Vec<EpisodeResult>> {
        let seeds: Vec<u64> = (0..self.args.episodes).map(|k| SeedDomain::Benchmark.seed(k)).collect();
        let bar = progress::steps(self.args.episodes, who);
        let episodes = Rollout::new(copies)
            .run(policy, &seeds, outcome, |more| bar.inc(more))
            .with_context(|| format!("{who} gave an action that cannot be taken"))?;
        bar.finish_and_clear();
        let result = |episode: RolledEpisode<_>| EpisodeResult {
            total_reward: episode.total_reward,
            coastal: episode.outcome,
        };
        Ok(episodes.into_iter().map(result).collect())
    }
}
