//! `searoom evaluate`: the return of a trained agent on episodes that it never saw.

use std::io::Write;
use std::path::PathBuf;

use anyhow::bail;
use clap::Args as ClapArgs;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::agent_run::{EnvMaker, POLICY, RunConfig, TracksPart, load_policy};
use super::progress;
use super::table::table;
use crate::env::SeedDomain;
use crate::nn::Compute;
use crate::rl::agent::Agent;
use crate::rl::trainer::run_episode;

/// Options of `searoom evaluate`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom evaluate runs/periodic
  searoom evaluate runs/periodic --episodes 500 --json

Actions are deterministic and the weights are those with the best evaluation during training. The seeds are
those of benchmarks: neither training nor its evaluations ever use them. Coastal encounters are those of the held-out
time.")]
pub struct Args {
    /// Folder of the run.
    run: PathBuf,
    /// Episodes to run.
    #[arg(long, default_value_t = 100)]
    episodes: u64,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Outcome {
    run: PathBuf,
    episodes: u64,
    mean_return: f64,
    sd_return: f64,
    least_return: f64,
    greatest_return: f64,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    if args.episodes < 2 {
        bail!("--episodes is {}: a spread needs two or more", args.episodes);
    }
    let config = RunConfig::of_run(&args.run)?;
    let mut env = EnvMaker::new(&config, TracksPart::HeldOut)?.make()?;
    let rng = &mut ChaCha8Rng::seed_from_u64(0);
    let mut agent = Agent::new(config.trainer.agent.clone(), env.observation_len(), env.action_len(), rng);
    load_policy(&args.run.join(POLICY), &mut agent)?;

    let compute = &mut Compute::new(1);
    let bar = progress::steps(args.episodes, "episodes");
    let mut returns = Vec::new();
    for episode in 0..args.episodes {
        returns.push(
            run_episode(&mut agent, env.as_mut(), SeedDomain::Benchmark.seed(episode), compute).total_reward,
        );
        bar.inc(1);
    }
    bar.finish_and_clear();

    let count = returns.len() as f64;
    let mean_return = returns.iter().sum::<f64>() / count;
    let outcome = Outcome {
        run: args.run,
        episodes: args.episodes,
        mean_return,
        sd_return: (returns.iter().map(|value| (value - mean_return).powi(2)).sum::<f64>() / (count - 1.0))
            .sqrt(),
        least_return: returns.iter().copied().fold(f64::INFINITY, f64::min),
        greatest_return: returns.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    if args.json {
        writeln!(out, "{}", serde_json::to_string(&outcome)?)?;
        return Ok(());
    }
    let mut rows = table(1, &["run", "episodes", "mean return", "sd", "least", "greatest"]);
    rows.add_row([
        outcome.run.display().to_string(),
        outcome.episodes.to_string(),
        format!("{:.2}", outcome.mean_return),
        format!("{:.2}", outcome.sd_return),
        format!("{:.0}", outcome.least_return),
        format!("{:.0}", outcome.greatest_return),
    ]);
    writeln!(out, "{rows}")?;
    Ok(())
}
