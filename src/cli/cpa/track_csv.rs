//! Tracks from CSV files with the columns `north_m`, `east_m` and `time_s` or `time_utc`.

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context, anyhow, bail, ensure};
use csv::StringRecord;
use nalgebra::Vector2;

use crate::ais::TimeForm;

/// Times may be off their grid by this much, in seconds.
const GRID_TOLERANCE_S: f64 = 1e-3;

/// A track in a file: `FILE.csv`, or `FILE.csv:N` where the file has several.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrackName {
    file: PathBuf,
    number: Option<u64>,
}

impl FromStr for TrackName {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbered = text.rsplit_once(':').and_then(|(file, number)| Some((file, number.parse().ok()?)));
        Ok(match numbered {
            Some((file, number)) => Self { file: file.into(), number: Some(number) },
            None => Self { file: text.into(), number: None },
        })
    }
}

impl std::fmt::Display for TrackName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.file.display())?;
        self.number.map_or(Ok(()), |number| write!(f, ":{number}"))
    }
}

/// Positions on a uniform grid of times, as x to the east and y to the north.
#[derive(Debug)]
pub struct TimedTrack {
    /// What the user calls it.
    pub name: TrackName,
    /// Time between two positions.
    pub dt_s: f64,
    start_s: f64,
    positions: Vec<Vector2<f64>>,
}

impl TimedTrack {
    /// Time of the first position.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Time of the last position.
    pub fn end_s(&self) -> f64 {
        self.start_s + self.dt_s * (self.positions.len() - 1) as f64
    }

    /// The times it covers, for a message.
    pub fn span(&self) -> String {
        format!("{} to {} s", self.start_s(), self.end_s())
    }

    /// Times of its positions.
    pub fn times_s(&self) -> impl Iterator<Item = f64> {
        (0..self.positions.len()).map(|step| self.start_s + self.dt_s * step as f64)
    }

    /// Where the vessel is at a time, held at the ends.
    pub fn position_at(&self, time_s: f64) -> Vector2<f64> {
        let (step, part) = self.place(time_s);
        self.positions[step].lerp(&self.positions[step + 1], part)
    }

    /// Its velocity over the step that begins at or contains a time; at the end, over the last step.
    pub fn velocity_at(&self, time_s: f64) -> Vector2<f64> {
        let (step, _) = self.place(time_s);
        (self.positions[step + 1] - self.positions[step]) / self.dt_s
    }

    fn place(&self, time_s: f64) -> (usize, f64) {
        let last = self.positions.len() - 1;
        let steps = ((time_s - self.start_s) / self.dt_s).clamp(0.0, last as f64);
        let step = ((steps + 1e-9).floor() as usize).min(last - 1);
        (step, (steps - step as f64).clamp(0.0, 1.0))
    }
}

/// Reads a track.
///
/// # Errors
/// Where the file cannot be read, a column is missing, a value is no number, the times are not
/// evenly spaced, or the track is not there; with file and line.
pub fn read(name: &TrackName) -> anyhow::Result<TimedTrack> {
    let file = name.file.display();
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(&name.file)
        .with_context(|| format!("{file}: cannot be read; check the path"))?;
    let columns = Columns::of(reader.headers().with_context(|| format!("{file}:1"))?)
        .with_context(|| format!("{file}:1"))?;
    ensure!(
        name.number.is_none() || columns.track.is_some(),
        "{file}:1: there is no column \"track\", so leave :{} away",
        name.number.unwrap_or_default()
    );
    let mut rows: Vec<(u64, f64, Vector2<f64>)> = Vec::new();
    let mut only_track: Option<String> = None;
    for record in reader.records() {
        let record = record.with_context(|| format!("{file}: not a CSV file of tracks"))?;
        let line = record.position().map_or(0, csv::Position::line);
        if let (Some(column), Some(number)) = (columns.track, name.number)
            && record.get(column).and_then(|text| text.parse().ok()) != Some(number)
        {
            continue;
        }
        if let Some(track) = columns.track.and_then(|column| record.get(column)) {
            let first = only_track.get_or_insert_with(|| track.to_owned());
            ensure!(
                first == track,
                "{file}:{line}: the file has several tracks; say which by its number, as in {file}:{first}"
            );
        }
        let (time_s, position) = columns.values(&record).with_context(|| format!("{file}:{line}"))?;
        rows.push((line, time_s, position));
    }
    on_a_grid(name, &rows)
}

fn on_a_grid(name: &TrackName, rows: &[(u64, f64, Vector2<f64>)]) -> anyhow::Result<TimedTrack> {
    let [(_, start_s, _), (_, second_s, _), ..] = rows else {
        bail!(
            "{name}: {} position(s) found; a track needs two, so check the file and the track's number",
            rows.len()
        );
    };
    let dt_s = second_s - start_s;
    ensure!(dt_s > 0.0, "{}:{}: time does not go on; sort the rows by time", name.file.display(), rows[1].0);
    for (step, (line, time_s, _)) in rows.iter().enumerate() {
        let expected_s = start_s + dt_s * step as f64;
        ensure!(
            (time_s - expected_s).abs() <= GRID_TOLERANCE_S,
            "{}:{line}: the times are not {dt_s} s apart here; resample the track first (searoom ais import does)",
            name.file.display()
        );
    }
    let positions = rows.iter().map(|(_, _, position)| *position).collect();
    Ok(TimedTrack { name: name.clone(), dt_s, start_s: *start_s, positions })
}

/// Where the columns stand.
struct Columns {
    north: usize,
    east: usize,
    time: usize,
    time_is_utc: bool,
    track: Option<usize>,
}

impl Columns {
    fn of(headings: &StringRecord) -> anyhow::Result<Self> {
        let find =
            |name: &str| headings.iter().position(|heading| heading.trim_start_matches('\u{feff}') == name);
        let need = |name: &str| {
            find(name).ok_or_else(|| anyhow!("there is no column \"{name}\"; add it, in metres"))
        };
        let (time, time_is_utc) = match (find("time_s"), find("time_utc")) {
            (Some(column), _) => (column, false),
            (None, Some(column)) => (column, true),
            (None, None) => bail!("there is no column \"time_s\" or \"time_utc\"; add one of them"),
        };
        Ok(Self { north: need("north_m")?, east: need("east_m")?, time, time_is_utc, track: find("track") })
    }

    fn values(&self, record: &StringRecord) -> anyhow::Result<(f64, Vector2<f64>)> {
        let number = |column: usize, name: &str| {
            let text = record.get(column).unwrap_or_default();
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| {
                anyhow!("column \"{name}\": \"{text}\" is not a number; correct it or drop the row")
            })
        };
        let time_s = if self.time_is_utc {
            let text = record.get(self.time).unwrap_or_default();
            let unix_ms = TimeForm::Iso.parse(text.as_bytes());
            let unix_ms = unix_ms.ok_or_else(|| {
                anyhow!("column \"time_utc\": \"{text}\" is not a time; write it as 2020-12-01T04:49:45Z")
            })?;
            unix_ms as f64 / 1000.0
        } else {
            number(self.time, "time_s")?
        };
        Ok((time_s, Vector2::new(number(self.east, "east_m")?, number(self.north, "north_m")?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str, number: Option<u64>) -> Result<TimedTrack, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("track.csv");
        std::fs::write(&file, text).unwrap();
        let folder = format!("{}/", folder.path().display());
        read(&TrackName { file, number }).map_err(|error| format!("{error:#}").replace(&folder, ""))
    }

    #[test]
    fn a_name_may_end_in_a_number() {
        let name: TrackName = "a/b.csv:12".parse().unwrap();
        assert_eq!(name, TrackName { file: "a/b.csv".into(), number: Some(12) });
        let plain: TrackName = "C:\\b.csv".parse().unwrap();
        assert_eq!(plain, TrackName { file: "C:\\b.csv".into(), number: None });
        assert_eq!(name.to_string(), "a/b.csv:12");
    }

    #[test]
    fn positions_and_velocities_lie_on_straight_lines() {
        let track = read_text("time_s,north_m,east_m\n10,0,0\n15,50,0\n20,50,40\n", None).unwrap();
        assert_eq!((track.dt_s, track.start_s(), track.end_s()), (5.0, 10.0, 20.0));
        assert_eq!(track.position_at(12.5), Vector2::new(0.0, 25.0));
        assert_eq!(track.position_at(99.0), Vector2::new(40.0, 50.0));
        assert_eq!(track.velocity_at(15.0), Vector2::new(8.0, 0.0));
        assert_eq!(track.velocity_at(20.0), Vector2::new(8.0, 0.0));
    }

    #[test]
    fn one_of_several_tracks_is_picked_by_its_number() {
        let text = "track,time_utc,north_m,east_m\n\
                    0,2020-12-01T00:00:00Z,1,1\n0,2020-12-01T00:00:05Z,2,2\n\
                    7,2020-12-01T00:00:00Z,3,3\n7,2020-12-01T00:00:05Z,4,4\n";
        assert_eq!(read_text(text, Some(7)).unwrap().position_at(0.0), Vector2::new(3.0, 3.0));
        let error = read_text(text, None).unwrap_err();
        assert_eq!(
            error,
            "track.csv:4: the file has several tracks; say which by its number, as in track.csv:0"
        );
        assert!(read_text(text, Some(1)).unwrap_err().contains("0 position(s) found"));
    }

    #[test]
    fn faults_name_file_line_and_remedy() {
        for (text, expected) in [
            ("", "no column"),
            ("time_s,north_m\n", "track.csv:1: there is no column \"east_m\"; add it"),
            ("north_m,east_m\n1,2\n", "track.csv:1: there is no column \"time_s\" or \"time_utc\""),
            ("time_s,north_m,east_m\n0,1,2\n", "1 position(s) found"),
            (
                "time_s,north_m,east_m\n0,1,2\n5,x,2\n",
                "track.csv:3: column \"north_m\": \"x\" is not a number",
            ),
            ("time_s,north_m,east_m\n0,1,2\n5,NaN,2\n", "track.csv:3: column \"north_m\": \"NaN\""),
            ("time_s,north_m,east_m\n0,1,2\n0,1,2\n", "track.csv:3: time does not go on"),
            ("time_s,north_m,east_m\n0,1,2\n5,1,2\n11,1,2\n", "track.csv:4: the times are not 5 s apart"),
            ("time_utc,north_m,east_m\nnoon,1,2\n", "track.csv:2: column \"time_utc\": \"noon\""),
            ("time_s,north_m,east_m\n0,1,2\n5,1\n", "not a CSV file of tracks"),
        ] {
            let error = read_text(text, None).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
        let error = read(&"no/such.csv".parse().unwrap()).unwrap_err();
        assert!(format!("{error:#}").starts_with("no/such.csv: cannot be read; check the path"), "{error:#}");
    }
}
