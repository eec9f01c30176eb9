//! `searoom forecast`: train, measure and show forecasters.

use std::io::Write;

use clap::{Args as ClapArgs, Subcommand};

pub(in crate::cli) mod data;
mod evaluate;
pub(in crate::cli) mod figures;
mod plot;
mod train;

/// Options of `searoom forecast`.
#[derive(Debug, ClapArgs)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train a forecaster, with checkpoints that resume exactly.
    Train(train::TrainArgs),
    /// Measure forecasters on held-out segments, beside the straight line.
    Evaluate(evaluate::EvaluateArgs),
    /// Draw the paper's figures of forecasts.
    Plot(plot::PlotArgs),
}

/// Runs the command.
///
/// # Errors
///
/// When the command fails; the message says where and what to do.
pub fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::Train(args) => train::run(&args, out),
        Command::Evaluate(args) => evaluate::run(&args, out),
        Command::Plot(args) => plot::run(&args, out),
    }
}
