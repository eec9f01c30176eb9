//! `searoom cpa`: the closest point of approach of two vessels, by all three methods.

mod encounter;
mod track_csv;

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use serde::Serialize;

use self::encounter::Encounter;
use self::track_csv::TrackName;
use super::table::table;
use crate::atomic_file;
use crate::cpa::refined::{RefineConfig, RefinedCpa, Refiner};
use crate::cpa::sampled::DistanceCurve;
use crate::cpa::{Cpa, CpaConfig, StraightMotion, linear};
use crate::experiment::smoothing_distance::Distances;
use crate::report::figure::Figure;

/// Closest point of approach of two vessels: closed form, sampled and refined
///
/// Own ship keeps the velocity it has at `--at`; the target ship goes where its track goes. The closed
/// form takes the target ship's present velocity instead.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  searoom cpa own.csv target.csv --at 120
  searoom cpa tracks.csv:3 tracks.csv:7 --smoothing 0 --plot smoothing_distance.svg
  searoom cpa --scenario scenarios/head_on.toml --at 60

A track is a CSV file with the columns north_m, east_m and time_s (or time_utc), as `searoom ais
import` writes it. With several tracks in the file, :N picks number N of the column track.")]
pub struct Args {
    /// Own ship's track: FILE.csv or FILE.csv:N
    #[arg(required_unless_present = "scenario")]
    own: Option<TrackName>,
    /// The target ship's track
    #[arg(required_unless_present = "scenario")]
    target: Option<TrackName>,
    /// Take both vessels from a scenario instead, run under its own policy
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["own", "target"])]
    scenario: Option<PathBuf>,
    /// The scenario's target ship to look at, by name [default: the first]
    #[arg(long, value_name = "NAME", requires = "scenario")]
    ship: Option<String>,
    /// What is now, in seconds after the start of the scenario or the first time both tracks cover
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    at: f64,
    /// Average distances over this many steps either side; 0 suits recorded tracks
    #[arg(long, value_name = "STEPS", default_value_t = CpaConfig::default().smoothing)]
    smoothing: usize,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Draw raw and smoothed distance with both minima
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    let encounter = match (&args.own, &args.target, &args.scenario) {
        (Some(own), Some(target), _) => {
            Encounter::of_tracks(&track_csv::read(own)?, &track_csv::read(target)?, args.at)?
        }
        (_, _, Some(file)) => Encounter::of_scenario(file, args.ship.as_deref(), args.at)?,
        _ => bail!("name two tracks or a scenario"),
    };
    let steps = encounter.target.len();
    let width = 2 * args.smoothing + 1;
    ensure!(
        steps >= width,
        "there are only {steps} time step(s), and --smoothing {} averages {width}: choose a smaller one",
        args.smoothing
    );
    let results = Results::of(&encounter, args.smoothing);
    if let Some(file) = &args.plot {
        let svg =
            results.figure().to_svg().map_err(anyhow::Error::from_boxed).context("cannot draw the figure")?;
        atomic_file::write(file, |out| out.write_all(svg.as_bytes()))?;
    }
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&results.summary(args.at))?)?;
    } else {
        results.print(out)?;
        if let Some(file) = &args.plot {
            writeln!(out, "figure: {}", file.display())?;
        }
    }
    Ok(())
}

/// The CPA by all methods.
struct Results {
    closed_form: Cpa,
    sampled: Cpa,
    refined: RefinedCpa,
    curve: DistanceCurve,
}

#[derive(Serialize)]
struct Summary {
    at_s: f64,
    smoothing_steps: usize,
    dt_s: f64,
    closed_form: Cpa,
    sampled: Cpa,
    refined: RefinedCpa,
    closed_form_less_refined: Cpa,
    sampled_less_refined: Cpa,
}

impl Results {
    fn of(encounter: &Encounter, smoothing: usize) -> Self {
        let mut curve = DistanceCurve::new(smoothing);
        curve.fill(encounter.own, encounter.target.iter().copied(), encounter.now, encounter.dt_s);
        let StraightMotion { position, velocity } = encounter.own;
        let target = encounter.target[encounter.now];
        Self {
            closed_form: linear::closest_approach(position, velocity, target, encounter.target_velocity),
            sampled: curve.closest(),
            refined: Refiner::new(RefineConfig::default()).closest(&curve),
            curve,
        }
    }

    fn less_refined(&self, cpa: Cpa) -> Cpa {
        let refined = self.refined.cpa;
        Cpa { distance_m: cpa.distance_m - refined.distance_m, time_s: cpa.time_s - refined.time_s }
    }

    fn summary(&self, at_s: f64) -> Summary {
        Summary {
            at_s,
            smoothing_steps: self.curve.half_width(),
            dt_s: self.curve.dt_s(),
            closed_form: self.closed_form,
            sampled: self.sampled,
            refined: self.refined,
            closed_form_less_refined: self.less_refined(self.closed_form),
            sampled_less_refined: self.less_refined(self.sampled),
        }
    }

    fn print(&self, out: &mut dyn Write) -> anyhow::Result<()> {
        let headings = ["method", "DCPA (m)", "TCPA (s)", "DCPA less refined (m)", "TCPA less refined (s)"];
        let mut table = table(1, &headings);
        let methods =
            [("closed form", self.closed_form), ("sampled", self.sampled), ("refined", self.refined.cpa)];
        for (name, cpa) in methods {
            let difference = self.less_refined(cpa);
            table.add_row([
                name.to_owned(),
                format!("{:.3}", cpa.distance_m),
                format!("{:.2}", cpa.time_s),
                format!("{:+.3}", difference.distance_m),
                format!("{:+.2}", difference.time_s),
            ]);
        }
        writeln!(out, "{table}")?;
        let RefinedCpa { solves, fallbacks, .. } = self.refined;
        writeln!(out, "cone programmes solved: {solves}, fallbacks to samples: {fallbacks}")?;
        Ok(())
    }

    /// The paper's figure `smoothing_distance`.
    fn figure(&self) -> Figure {
        Distances { curve: &self.curve, sampled: self.sampled, refined: self.refined.cpa }.figure()
    }
}
