//! An episode as CSV, which spreadsheets and pandas read, and as JSON lines, which programs read.
//!
//! At these edges angles are in degrees clockwise from north and speeds in knots; every column says
//! so.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::atomic_file::{self, WriteError};
use crate::episode::{Episode, PairStep, TargetSummary, VesselInfo, VesselStep};
use crate::geo::{Geodetic, MPS_PER_KNOT, Position};

/// One row of `episode.csv`. What concerns a pair stands in the target ship's row; own ship's row has
/// nothing there.
#[derive(Debug, Serialize)]
struct Row<'a> {
    step: usize,
    time_s: f64,
    vessel: usize,
    name: &'a str,
    role: &'a str,
    north_m: f64,
    east_m: f64,
    heading_deg: f64,
    course_deg: f64,
    speed_kn: f64,
    observed_north_m: Option<f64>,
    observed_east_m: Option<f64>,
    centre_distance_m: Option<f64>,
    hull_distance_m: Option<f64>,
    closest_centre_m: Option<f64>,
    closest_centre_time_s: Option<f64>,
    closest_hull_m: Option<f64>,
    circle_contact_time_s: Option<f64>,
    hull_contact_time_s: Option<f64>,
}

/// Writes `episode.csv`: one row per step and vessel, steps in order, own ship first.
///
/// # Errors
/// Where the file cannot be written.
pub fn write_csv(episode: &Episode, folder: &Path) -> Result<PathBuf, WriteError> {
    let path = folder.join("episode.csv");
    atomic_file::write(&path, |out| csv_rows(episode, out))?;
    Ok(path)
}

fn csv_rows(episode: &Episode, out: &mut dyn Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    for (step, state) in episode.steps.iter().enumerate() {
        for (index, (info, vessel)) in episode.vessels.iter().zip(&state.vessels).enumerate() {
            let pair = index.checked_sub(1).and_then(|pair| state.pairs.get(pair));
            writer.serialize(Row {
                step,
                time_s: episode.time_s(step),
                vessel: index,
                name: &info.name,
                role: info.role.as_str(),
                north_m: vessel.position.north_m,
                east_m: vessel.position.east_m,
                heading_deg: vessel.heading.degrees(),
                course_deg: vessel.velocity.course().degrees(),
                speed_kn: vessel.velocity.speed_mps() / MPS_PER_KNOT,
                observed_north_m: vessel.observed.map(|position| position.north_m),
                observed_east_m: vessel.observed.map(|position| position.east_m),
                centre_distance_m: pair.map(|pair| pair.centre_distance_m),
                hull_distance_m: pair.map(|pair| pair.hull_distance_m),
                closest_centre_m: pair.map(|pair| pair.closest_centre_m),
                closest_centre_time_s: pair.map(|pair| pair.closest_centre_time_s),
                closest_hull_m: pair.map(|pair| pair.closest_hull_m),
                circle_contact_time_s: pair.and_then(|pair| pair.circle_contact_time_s),
                hull_contact_time_s: pair.and_then(|pair| pair.hull_contact_time_s),
            })?;
        }
    }
    writer.flush()
}

/// One line of `episode.jsonl`.
#[derive(Debug, Serialize)]
#[serde(tag = "record", rename_all = "snake_case")]
enum Line<'a> {
    /// The first line: what does not change.
    Episode {
        scenario: &'a str,
        description: &'a str,
        seed: u64,
        policy: &'a str,
        dt_s: f64,
        origin: Option<Geodetic>,
        vessels: &'a [VesselInfo],
    },
    /// One line per step.
    Step { step: usize, time_s: f64, vessels: Vec<VesselLine<'a>>, pairs: &'a [PairStep] },
    /// The last line: what came of each target ship.
    Summary { contact: bool, targets: Vec<TargetSummary> },
}

#[derive(Debug, Serialize)]
struct VesselLine<'a> {
    north_m: f64,
    east_m: f64,
    heading_deg: f64,
    course_deg: f64,
    speed_kn: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    observed: Option<Position>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    ahead: &'a [Position],
}

impl<'a> From<&'a VesselStep> for VesselLine<'a> {
    fn from(vessel: &'a VesselStep) -> Self {
        Self {
            north_m: vessel.position.north_m,
            east_m: vessel.position.east_m,
            heading_deg: vessel.heading.degrees(),
            course_deg: vessel.velocity.course().degrees(),
            speed_kn: vessel.velocity.speed_mps() / MPS_PER_KNOT,
            observed: vessel.observed,
            ahead: &vessel.ahead,
        }
    }
}

/// Writes `episode.jsonl`: a line about the episode, one per step, and a summary. Each line says in
/// `record` which it is.
///
/// # Errors
/// Where the file cannot be written.
pub fn write_jsonl(episode: &Episode, folder: &Path) -> Result<PathBuf, WriteError> {
    let path = folder.join("episode.jsonl");
    atomic_file::write(&path, |out| json_lines(episode, out))?;
    Ok(path)
}

fn json_lines(episode: &Episode, out: &mut dyn Write) -> io::Result<()> {
    let mut line = |line: &Line<'_>| -> io::Result<()> {
        serde_json::to_writer(&mut *out, line)?;
        out.write_all(b"\n")
    };
    line(&Line::Episode {
        scenario: &episode.scenario,
        description: &episode.description,
        seed: episode.seed,
        policy: &episode.policy,
        dt_s: episode.dt_s,
        origin: episode.origin,
        vessels: &episode.vessels,
    })?;
    for (step, state) in episode.steps.iter().enumerate() {
        line(&Line::Step {
            step,
            time_s: episode.time_s(step),
            vessels: state.vessels.iter().map(VesselLine::from).collect(),
            pairs: &state.pairs,
        })?;
    }
    line(&Line::Summary { contact: episode.has_contact(), targets: episode.summaries() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::tests::head_on;

    fn text(fill: impl Fn(&Episode, &mut dyn Write) -> io::Result<()>, episode: &Episode) -> String {
        let mut bytes = Vec::new();
        fill(episode, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn the_csv_has_a_row_per_step_and_vessel() {
        let text = text(csv_rows, &head_on(40.0));
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let headings = reader.headers().unwrap().clone();
        let column = |name: &str| headings.iter().position(|heading| heading == name).unwrap();
        let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 2 * 61);
        let (own, target) = (&rows[60], &rows[61]);
        assert_eq!((&own[column("role")], &target[column("role")]), ("own", "target"));
        assert_eq!((&own[column("step")], &own[column("time_s")]), ("30", "150.0"));
        assert_eq!((&own[column("centre_distance_m")], &own[column("observed_north_m")]), ("", ""));
        assert_eq!(target[column("heading_deg")].parse::<f64>().unwrap(), 180.0);
        let speed_kn: f64 = target[column("speed_kn")].parse().unwrap();
        assert!((speed_kn - 15.550_755_939_524_838).abs() < 1e-9);
        assert!(!target[column("circle_contact_time_s")].is_empty());
    }

    #[test]
    fn names_with_commas_and_quotes_survive_the_csv() {
        let mut episode = head_on(40.0);
        episode.vessels[1].name = "MV \"Anna\", Ltd\nB".to_owned();
        let text = text(csv_rows, &episode);
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(&reader.records().nth(1).unwrap().unwrap()[3], "MV \"Anna\", Ltd\nB");
    }

    #[test]
    fn the_json_lines_tell_what_they_are() {
        let text = text(json_lines, &head_on(40.0));
        let lines: Vec<serde_json::Value> =
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert_eq!(lines.len(), 63);
        assert_eq!(lines[0]["record"], "episode");
        assert_eq!(lines[0]["vessels"][1]["name"], "target 1");
        assert_eq!(lines[31]["record"], "step");
        assert_eq!(lines[31]["step"], 30);
        assert_eq!(lines[31]["vessels"][1]["heading_deg"], 180.0);
        assert_eq!(lines[62]["record"], "summary");
        assert_eq!(lines[62]["contact"], true);
        assert_eq!(lines[62]["targets"][0]["closest_centre_m"], 40.0);
    }
}
