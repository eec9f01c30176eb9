//! `searoom benchmark`: policies compared on the same encounters.

use std::io::Write;

use clap::Subcommand;

mod imazu;
mod noise;

/// The benchmarks.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The 22 Imazu problems: standard encounters with up to three ships
    Imazu(imazu::Args),
    /// Contacts of agents and classical policies in recorded traffic, as sensors get worse
    Noise(noise::Args),
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::Imazu(args) => imazu::run(&args, out),
        Command::Noise(args) => noise::run(&args, out),
    }
}
