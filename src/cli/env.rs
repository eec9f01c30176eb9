//! `searoom env`: the environments, and what each shows, takes and rewards.

use std::io::Write;

use clap::Args as ClapArgs;

use super::table::table;
use crate::agent::RunConfig;
use crate::env::EnvName;
use crate::env::registry::{Description, Value};

/// Options of `searoom env`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom env
  searoom env coastal
  searoom env open-water --no-estimates --json")]
pub struct Args {
    /// The environment; without it, all of them are listed.
    #[arg(value_name = "open-water|coastal")]
    name: Option<EnvName>,
    /// The baseline's observation, without estimates of the collision risk.
    #[arg(long)]
    no_estimates: bool,
    /// Print JSON instead of tables.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    let describe = |name: EnvName| RunConfig::of(name).describe(!args.no_estimates);
    let Some(name) = args.name else {
        let all: Vec<Description> = EnvName::ALL.map(describe).into();
        if args.json {
            writeln!(out, "{}", serde_json::to_string(&all)?)?;
            return Ok(());
        }
        let mut rows = table(2, &["environment", "what it is", "observation"]);
        for description in all {
            let length = description.observation_len.to_string();
            rows.add_row([description.name.as_str().to_owned(), description.summary.to_owned(), length]);
        }
        writeln!(out, "{rows}")?;
        return Ok(());
    };
    let description = describe(name);
    if args.json {
        writeln!(out, "{}", serde_json::to_string(&description)?)?;
        return Ok(());
    }
    writeln!(out, "{}: {}", name.as_str(), description.summary)?;
    writeln!(out, "{}", description.episode)?;
    print(out, "observation", &description.observation)?;
    writeln!(out, "{}", description.order)?;
    print(out, "action", &description.action)?;
    print(out, "reward", &description.reward)
}

fn print(out: &mut dyn Write, what: &str, values: &[Value]) -> anyhow::Result<()> {
    let mut rows = table(4, &[what, "value", "scale", "range"]);
    for Value { index, meaning, scale, range } in values {
        rows.add_row([index, meaning, scale, *range]);
    }
    writeln!(out, "{rows}")?;
    Ok(())
}
