//! `searoom experiment`: the paper's figures, one command each.

mod agents;
mod collect;
mod from_scratch;
mod inputs;
mod make;
mod runs;

use std::io::Write;

use clap::{Args as ClapArgs, Subcommand};

use super::table::table;
use crate::experiment::{Experiment, Needs};

/// Options of `searoom experiment`.
#[derive(Debug, ClapArgs)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// What figures there are, and what each needs
    List(ListArgs),
    /// Make a figure (SVG) and its data (CSV)
    Run(make::RunArgs),
    /// Keep the learning curves of finished runs
    Collect(collect::CollectArgs),
}

/// Options of `searoom experiment list`.
#[derive(Debug, ClapArgs)]
struct ListArgs {
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
///
/// When the command fails; the message says where and what to do.
pub fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::List(args) => list(&args, out),
        Command::Run(args) => make::run(&args, out),
        Command::Collect(args) => collect::run(&args, out),
    }
}

fn list(args: &ListArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let described = Experiment::ALL.map(Experiment::description);
    if args.json {
        let entries: Vec<_> = described
            .iter()
            .map(|(name, shows, needs)| {
                serde_json::json!({ "name": name, "shows": shows, "needs": needs_text(*needs) })
            })
            .collect();
        writeln!(out, "{}", serde_json::to_string_pretty(&entries)?)?;
        return Ok(());
    }
    let mut rows = table(3, &["name", "shows", "needs"]);
    for (name, shows, needs) in described {
        rows.add_row([name, shows, needs_text(needs)]);
    }
    writeln!(out, "{rows}")?;
    writeln!(out, "next: searoom experiment run NAME, or all")?;
    Ok(())
}

fn needs_text(needs: Needs) -> &'static str {
    match needs {
        Needs::Nothing => "nothing",
        Needs::Forecasters(_) => "open-water forecasters",
        Needs::CoastalForecaster => "coastal forecaster, recorded tracks",
        Needs::ForecasterLogs => "logs of forecasters' trainings",
        Needs::Curves(_) => "learning curves of agents",
        Needs::Ablation => "learning curves over history lengths",
        Needs::Agents(_) => "a trained agent and its baseline",
        Needs::NoiseBenchmark => "the table of the noise benchmark",
    }
}
