//! The command line: one file and one line of `Command` per subcommand.
//!
//! Results go to standard output, progress and errors to standard error. The exit code is 0 on
//! success, 1 on failure, 2 where the command line itself is wrong.

use std::ffi::OsString;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

mod agent_run;
mod agent_training;
pub mod ais;
mod benchmark;
mod cache;
pub mod cpa;
pub mod env;
pub mod evaluate;
pub mod experiment;
pub mod export;
pub mod forecast;
mod policies;
pub mod progress;
mod recorded;
mod run_log;
pub mod scenario;
pub mod sweep;
pub mod table;
pub mod train;
pub mod tune;
pub mod vessel;

#[derive(Debug, Parser)]
#[command(name = "searoom", version, about, long_about = LONG_ABOUT, after_help = EXAMPLES)]
#[command(arg_required_else_help = true, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const LONG_ABOUT: &str = "Searoom simulates vessels at close quarters, from recorded traffic and from \
scripts, and lets agents learn to keep clear of them.\n\n\
Angles are degrees clockwise from north, speeds knots, distances metres or nautical miles; every key and \
column carries its unit in its name.";

const EXAMPLES: &str = "\
Each command explains itself with examples: searoom help COMMAND";

macro_rules! subcommands {
    ($($(#[$doc:meta])* $name:ident($module:ident)),* $(,)?) => {
        #[derive(Debug, Subcommand)]
        enum Command { $($(#[$doc])* $name($module::Args)),* }

        impl Command {
            fn run(self, out: &mut dyn Write) -> anyhow::Result<()> {
                match self { $(Self::$name(args) => $module::run(args, out)),* }
            }
        }
    };
}

// Every module named here has `pub struct Args`, a `clap::Args`, and
// `pub fn run(Args, &mut dyn Write) -> anyhow::Result<()>`.
subcommands! {
    /// Import recorded traffic, look at its tracks, draw them
    Ais(ais),
    /// List, check and run scripted encounters
    Scenario(scenario),
    /// Search settings of a classical policy, on training seeds
    Tune(tune),
    /// Train, measure and show forecasts of where vessels will go
    Forecast(forecast),
    /// The environments that agents are trained in: what each shows, takes and rewards
    Env(env),
    /// Train an agent to keep clear, with checkpoints that resume
    Train(train),
    /// Train a grid of agents and seeds over the available cores
    Sweep(sweep),
    /// How a trained agent does on episodes that it never saw
    Evaluate(evaluate),
    /// Put the agent of a run into one file
    Export(export),
    /// Make the paper's figures, each with one command
    Experiment(experiment),
    /// Compare policies on the same encounters
    Benchmark(benchmark),
    /// Standard manoeuvres of a ship with real dynamics
    Vessel(vessel),
    /// Closest point of approach of two vessels: closed form, sampled and refined
    Cpa(cpa),
}

/// Runs the program on a command line, its name first, and returns the exit code.
pub fn run(command_line: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> ExitCode {
    let cli = match Cli::try_parse_from(command_line) {
        Ok(cli) => cli,
        Err(message) => {
            // A closed pipe is the only way this fails, and then nobody reads.
            let _ = message.print();
            return ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(2));
        }
    };
    let mut out = io::stdout().lock();
    match cli.command.run(&mut out).and_then(|()| Ok(out.flush()?)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// The error and its causes in one line. A cause that the error above it already quotes is left
/// out.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !line.contains(&cause) {
            line = format!("{line}: {cause}");
        }
    }
    line
}

/// Whether standard output went away, as in `searoom ... | head`.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|error| error.kind() == io::ErrorKind::BrokenPipe)
}
