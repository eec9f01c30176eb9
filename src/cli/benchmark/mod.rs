//! `searoom benchmark`: policies compared on the same encounters.

use std::io::Write;

use clap::Subcommand;

mod noise;

/// The benchmarks.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Contacts of agents and classical policies in recorded traffic, as sensors get worse
    Noise(noise::Args),
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::Noise(args) => noise::run(&args, out),
    }
}
