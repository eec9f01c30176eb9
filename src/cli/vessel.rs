//! `searoom vessel`: the standard manoeuvres of KVLCC2 beside what is published of them.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use clap::{Subcommand, ValueEnum};
use serde::Serialize;

use super::table::table;
use crate::angle::Nautical;
use crate::atomic_file;
use crate::geo::{MPS_PER_KNOT, Velocity};
use crate::report::figure::{Figure, Line, Panel, colour};
use crate::vessel::mmg::manoeuvre::{ManoeuvreConfig, Moment, TurningCircle, ZigZag, turning_circle, zigzag};
use crate::vessel::mmg::published::{
    IMO_ADVANCE, IMO_TACTICAL_DIAMETER, PublishedTurn, PublishedZigZag, TURN_PORT, TURN_STARBOARD, ZIGZAGS,
};
use crate::vessel::mmg::{Hydrodynamics, MmgParameters, ParameterSet, Surroundings, Wind};

/// Rudder angle of the published turning circles, in degrees.
const PUBLISHED_RUDDER_DEG: f64 = 35.0;
/// Moments of a manoeuvre that a file keeps: one in so many.
const THINNING: usize = 10;

/// The vessel commands.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Turning circles of KVLCC2 to both sides
    #[command(
        after_help = "Examples:\n  searoom vessel turn\n  searoom vessel turn --rudder-deg 20 --json\n  \
        searoom vessel turn --current-towards-deg 90 --current-kn 2 --wind-from-deg 45 --wind-kn 30"
    )]
    Turn(TurnArgs),
    /// Zig-zag tests of KVLCC2, starting to either side
    #[command(
        after_help = "Examples:\n  searoom vessel zigzag\n  searoom vessel zigzag --angle-deg 15 --json"
    )]
    Zigzag(ZigzagArgs),
}

#[derive(Debug, clap::Args)]
struct CommonArgs {
    /// Which values go with the published coefficients; see docs/physics.md
    #[arg(long, value_enum, default_value_t = Set::Benchmark)]
    parameters: Set,
    /// Rate at which the rudder moves [default: that of the publication, 1.76]
    #[arg(long)]
    rudder_rate_deg_per_s: Option<f64>,
    /// Direction that a current sets towards, clockwise from the approach course
    #[arg(long, requires = "current_kn", allow_negative_numbers = true)]
    current_towards_deg: Option<f64>,
    /// Speed of the current
    #[arg(long, requires = "current_towards_deg")]
    current_kn: Option<f64>,
    /// Direction that a wind blows from, clockwise from the approach course
    #[arg(long, requires = "wind_kn", allow_negative_numbers = true)]
    wind_from_deg: Option<f64>,
    /// Speed of the wind
    #[arg(long, requires = "wind_from_deg")]
    wind_kn: Option<f64>,
    /// Directory for the picture and the time series [default: out/turn or out/zigzag]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Print the results as JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct TurnArgs {
    /// Rudder angle
    #[arg(long, default_value_t = PUBLISHED_RUDDER_DEG)]
    rudder_deg: f64,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, clap::Args)]
struct ZigzagArgs {
    /// Rudder angle, and heading at which it is reversed [default: 10 and 20]
    #[arg(long)]
    angle_deg: Vec<f64>,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Set {
    Benchmark,
    AsPrinted,
    TrueFullScale,
}

impl From<Set> for ParameterSet {
    fn from(set: Set) -> Self {
        match set {
            Set::Benchmark => Self::Benchmark,
            Set::AsPrinted => Self::AsPrinted,
            Set::TrueFullScale => Self::TrueFullScale,
        }
    }
}

impl CommonArgs {
    fn ship(&self) -> anyhow::Result<Hydrodynamics> {
        let parameters = ParameterSet::from(self.parameters).parameters();
        let rate = self.rudder_rate_deg_per_s.unwrap_or(parameters.rudder_rate_deg_per_s);
        in_range("--rudder-rate-deg-per-s", rate, 0.1, 100.0)?;
        Ok(Hydrodynamics::new(MmgParameters { rudder_rate_deg_per_s: rate, ..parameters }))
    }

    fn manoeuvre(&self) -> anyhow::Result<ManoeuvreConfig> {
        let direction = |option: &str, degrees: f64| -> anyhow::Result<Nautical> {
            in_range(option, degrees, -360.0, 360.0)?;
            Ok(Nautical::from_degrees(degrees))
        };
        let mut surroundings = Surroundings::default();
        if let (Some(towards_deg), Some(speed_kn)) = (self.current_towards_deg, self.current_kn) {
            in_range("--current-kn", speed_kn, 0.0, 20.0)?;
            let towards = direction("--current-towards-deg", towards_deg)?;
            surroundings.current = Velocity::from_course(towards, speed_kn * MPS_PER_KNOT);
        }
        if let (Some(from_deg), Some(speed_kn)) = (self.wind_from_deg, self.wind_kn) {
            in_range("--wind-kn", speed_kn, 0.0, 100.0)?;
            let from = direction("--wind-from-deg", from_deg)?;
            surroundings.wind = Some(Wind { from, speed_mps: speed_kn * MPS_PER_KNOT });
        }
        Ok(ManoeuvreConfig { surroundings, ..ManoeuvreConfig::default() })
    }

    fn surroundings(&self) -> WrittenSurroundings {
        WrittenSurroundings {
            current_towards_deg: self.current_towards_deg,
            current_kn: self.current_kn,
            wind_from_deg: self.wind_from_deg,
            wind_kn: self.wind_kn,
        }
    }
}

/// Current and wind as they were given; nothing where there is none.
#[derive(Debug, PartialEq, Serialize)]
struct WrittenSurroundings {
    current_towards_deg: Option<f64>,
    current_kn: Option<f64>,
    wind_from_deg: Option<f64>,
    wind_kn: Option<f64>,
}

impl WrittenSurroundings {
    /// Still water and air, for which results are published.
    fn are_still(&self) -> bool {
        self.current_kn.is_none() && self.wind_kn.is_none()
    }
}

fn in_range(option: &str, value: f64, least: f64, most: f64) -> anyhow::Result<()> {
    if !(least..=most).contains(&value) {
        bail!("{option} is {value}: give a number from {least} to {most}");
    }
    Ok(())
}

/// Runs the command.
///
/// # Errors
/// Angles that no rudder has, manoeuvres that never end, files that cannot be written.
pub fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::Turn(args) => turn(&args, out),
        Command::Zigzag(args) => zigzags(&args, out),
    }
}

#[derive(Debug, Serialize)]
struct TurnSide {
    #[serde(flatten)]
    circle: TurningCircle,
    #[serde(skip_serializing_if = "Option::is_none")]
    published: Option<PublishedTurn>,
}

#[derive(Debug, Serialize)]
struct TurnResults {
    parameters: ParameterSet,
    #[serde(skip_serializing_if = "WrittenSurroundings::are_still")]
    surroundings: WrittenSurroundings,
    starboard: TurnSide,
    port: TurnSide,
}

fn turn(args: &TurnArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let ship = args.common.ship()?;
    in_range("--rudder-deg", args.rudder_deg, 1.0, ship.max_rudder_rad().to_degrees() + 1e-9)?;
    let (config, surroundings) = (args.common.manoeuvre()?, args.common.surroundings());
    let is_published = args.rudder_deg == PUBLISHED_RUDDER_DEG && surroundings.are_still();
    let side = |sign: f64, published: PublishedTurn| -> anyhow::Result<(TurnSide, Vec<Moment>)> {
        let rudder_rad = (sign * args.rudder_deg).to_radians();
        let (circle, moments) = turning_circle(&ship, rudder_rad, config)
            .ok_or_else(|| anyhow!("the ship does not come round within an hour: give more rudder"))?;
        let published = is_published.then_some(published);
        Ok((TurnSide { circle, published }, moments))
    };
    let (starboard, starboard_track) = side(1.0, TURN_STARBOARD)?;
    let (port, port_track) = side(-1.0, TURN_PORT)?;

    let folder = args.common.out.clone().unwrap_or_else(|| PathBuf::from("out/turn"));
    write_series(&folder.join("starboard.csv"), &starboard_track)?;
    write_series(&folder.join("port.csv"), &port_track)?;
    let length_m = ship.parameters().length_m;
    write_figure(&folder.join("turn.svg"), &turn_figure(&starboard_track, &port_track, length_m))?;

    let results = TurnResults { parameters: args.common.parameters.into(), surroundings, starboard, port };
    if args.common.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&results)?)?;
        return Ok(());
    }
    writeln!(out, "{}", turn_table(&results))?;
    writeln!(
        out,
        "Lengths over L = {length_m:.0} m. IMO MSC.137(76): advance up to {IMO_ADVANCE} L, tactical diameter up \
         to {IMO_TACTICAL_DIAMETER} L."
    )?;
    finish(&folder, out)
}

/// What the asterisks mean, and where the rest went.
fn finish(folder: &Path, out: &mut dyn Write) -> anyhow::Result<()> {
    writeln!(
        out,
        "* Calculated: Yasukawa & Yoshimura 2015, to port quoted from memory. Measured: free running model \
         tests, SIMMAN 2008."
    )?;
    writeln!(out, "Picture and time series: {}", folder.display())?;
    Ok(())
}

fn turn_table(results: &TurnResults) -> comfy_table::Table {
    let mut rows = table(1, &["Turning circle", "Side", "Here", "Calculated*", "Measured*"]);
    for (name, side) in [("starboard", &results.starboard), ("port", &results.port)] {
        let circle = &side.circle;
        let published = |value: fn(&PublishedTurn) -> f64| {
            side.published.as_ref().map_or_else(String::new, |published| format!("{:.2}", value(published)))
        };
        let mut row = |quantity: &str, here: String, calculated: String, measured: String| {
            rows.add_row([quantity.to_owned(), name.to_owned(), here, calculated, measured]);
        };
        row(
            "Advance / L",
            format!("{:.2}", circle.advance_over_length),
            published(|turn| turn.advance_calculated),
            published(|turn| turn.advance_measured),
        );
        row(
            "Transfer / L",
            format!("{:.2}", circle.transfer_over_length),
            String::new(),
            published(|turn| turn.transfer_measured),
        );
        row(
            "Tactical diameter / L",
            format!("{:.2}", circle.tactical_diameter_over_length),
            published(|turn| turn.tactical_diameter_calculated),
            published(|turn| turn.tactical_diameter_measured),
        );
        row("Time to 90 deg (s)", format!("{:.0}", circle.time_to_90_s), String::new(), String::new());
        row("Time to 180 deg (s)", format!("{:.0}", circle.time_to_180_s), String::new(), String::new());
        row("Steady speed / U0", format!("{:.2}", circle.steady_speed_ratio), String::new(), String::new());
        row("Steady drift (deg)", format!("{:.1}", circle.steady_drift_deg), String::new(), String::new());
    }
    rows
}

fn turn_figure(starboard: &[Moment], port: &[Moment], length_m: f64) -> Figure {
    let sides = [(colour::GREEN, starboard), (colour::ORANGE, port)];
    let panel = |title: &str, x_label: &str, y_label: &str, point: &dyn Fn(&Moment) -> (f64, f64)| Panel {
        title: title.to_owned(),
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        lines: sides
            .iter()
            .map(|(colour, moments)| Line::solid("", *colour, thinned(moments).map(point).collect()))
            .collect(),
        ..Panel::default()
    };
    let track = panel("Track of midship", "transfer / L", "advance / L", &|moment| {
        (moment.transfer_m / length_m, moment.advance_m / length_m)
    });
    let speed = panel(
        "Speed (port orange, starboard green)",
        "time (s)",
        "speed through the water (m/s)",
        &|moment| (moment.time_s, moment.speed_mps),
    );
    Figure { panels: vec![Panel { equal_scales: true, ..track }, speed], columns: 2 }
}

#[derive(Debug, Serialize)]
struct ZigZagResult {
    #[serde(flatten)]
    test: ZigZag,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured_overshoots_deg: Option<[f64; 2]>,
}

#[derive(Debug, Serialize)]
struct ZigZagResults {
    parameters: ParameterSet,
    #[serde(skip_serializing_if = "WrittenSurroundings::are_still")]
    surroundings: WrittenSurroundings,
    tests: Vec<ZigZagResult>,
}

fn zigzags(args: &ZigzagArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let ship = args.common.ship()?;
    let angles = if args.angle_deg.is_empty() { vec![10.0, 20.0] } else { args.angle_deg.clone() };
    let folder = args.common.out.clone().unwrap_or_else(|| PathBuf::from("out/zigzag"));
    let (config, surroundings) = (args.common.manoeuvre()?, args.common.surroundings());
    let (mut tests, mut panels) = (Vec::new(), Vec::new());
    for angle_deg in angles {
        in_range("--angle-deg", angle_deg, 1.0, ship.max_rudder_rad().to_degrees() + 1e-9)?;
        for starboard_first in [true, false] {
            let angle_rad = angle_deg.to_radians();
            let (test, moments) = zigzag(&ship, angle_rad, angle_rad, starboard_first, config)
                .ok_or_else(|| anyhow!("the ship does not answer within an hour: give more rudder"))?;
            let side = if starboard_first { "starboard" } else { "port" };
            write_series(&folder.join(format!("{angle_deg}_{side}_first.csv")), &moments)?;
            panels.push(zigzag_panel(&format!("{angle_deg}/{angle_deg} deg, {side} first"), &moments));
            let measured_overshoots_deg = ZIGZAGS
                .iter()
                .filter(|_| surroundings.are_still())
                .find(|known| known.angle_deg == angle_deg && known.starboard_first == starboard_first)
                .map(|known: &PublishedZigZag| known.overshoots_deg);
            tests.push(ZigZagResult { test, measured_overshoots_deg });
        }
    }
    write_figure(&folder.join("zigzag.svg"), &Figure { panels, columns: 2 })?;

    let results = ZigZagResults { parameters: args.common.parameters.into(), surroundings, tests };
    if args.common.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&results)?)?;
        return Ok(());
    }
    writeln!(out, "{}", zigzag_table(&results))?;
    finish(&folder, out)
}

fn zigzag_table(results: &ZigZagResults) -> comfy_table::Table {
    let mut rows = table(2, &["Zig-zag", "First to", "Overshoot", "Here (deg)", "Measured* (deg)"]);
    for ZigZagResult { test, measured_overshoots_deg } in &results.tests {
        for (index, overshoot_deg) in test.overshoots_deg.iter().enumerate() {
            rows.add_row([
                format!("{:.0}/{:.0}", test.rudder_deg, test.heading_deg),
                if test.starboard_first { "starboard" } else { "port" }.to_owned(),
                (index + 1).to_string(),
                format!("{overshoot_deg:.1}"),
                measured_overshoots_deg
                    .map_or_else(String::new, |measured| format!("{:.1}", measured[index])),
            ]);
        }
    }
    rows
}

fn zigzag_panel(title: &str, moments: &[Moment]) -> Panel {
    let line = |colour, value: fn(&Moment) -> f64| {
        Line::solid("", colour, thinned(moments).map(|moment| (moment.time_s, value(moment))).collect())
    };
    Panel {
        title: title.to_owned(),
        x_label: "time (s)".to_owned(),
        y_label: "rudder (grey), heading (blue), deg".to_owned(),
        lines: vec![
            line(colour::GREY, |moment| moment.rudder_deg),
            line(colour::BLUE, |moment| moment.heading_deg),
        ],
        ..Panel::default()
    }
}

fn thinned(moments: &[Moment]) -> impl Iterator<Item = &Moment> {
    moments.iter().step_by(THINNING)
}

fn write_series(path: &Path, moments: &[Moment]) -> anyhow::Result<()> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for moment in thinned(moments) {
        csv.serialize(moment)?;
    }
    let bytes = csv.into_inner().map_err(|error| error.into_error())?;
    atomic_file::write(path, |file| file.write_all(&bytes))?;
    Ok(())
}

fn write_figure(path: &Path, figure: &Figure) -> anyhow::Result<()> {
    let svg = figure.to_svg().map_err(|error| anyhow!(error)).context("the picture cannot be drawn")?;
    atomic_file::write(path, |file| file.write_all(svg.as_bytes()))?;
    Ok(())
}
