//! `searoom export`: the agent of a run in one file, to ship and to sail with.

use std::io::Write;
use std::path::PathBuf;

use clap::Args as ClapArgs;

use crate::agent::TrainedAgent;

/// Options of `searoom export`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom export runs/coastal-lstm-sac-seed-1 --out models/agents/coastal-lstm-sac.safetensors
  searoom evaluate models/agents/coastal-lstm-sac.safetensors
  searoom scenario run scenarios/head_on.toml --policy models/agents/coastal-lstm-sac.safetensors

The file holds the weights with the best evaluation and the whole configuration of the run.")]
pub struct Args {
    /// Folder of the run.
    run: PathBuf,
    /// The file to write.
    #[arg(long)]
    out: PathBuf,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    let mut agent = TrainedAgent::open(&args.run)?;
    agent.to_file().save(&args.out)?;
    writeln!(
        out,
        "{}: {}, step {}, mean return {:.2} in its evaluation",
        args.out.display(),
        agent.name,
        agent.step,
        agent.mean_return
    )?;
    Ok(())
}
