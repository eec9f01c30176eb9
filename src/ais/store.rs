//! Tracks in a folder: `tracks.csv` with one row per position, `tracks.json` with their
//! provenance, `bad_rows.csv` with the rows that could not be read.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufReader, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::area::Area;
use super::config::ImportConfig;
use super::error::AisError;
use super::format::ColumnMapping;
use super::read::time::{TimeForm, iso_utc};
use super::report::Report;
use super::{BadRow, Import};
use crate::atomic_file;
use crate::geo::{LocalPlane, MPS_PER_KNOT, Position};
use crate::track::{Track, VesselParticulars};

const TRACKS_CSV: &str = "tracks.csv";
const TRACKS_JSON: &str = "tracks.json";
const BAD_ROWS_CSV: &str = "bad_rows.csv";

/// Header of `tracks.csv`.
const COLUMNS: [&str; 9] =
    ["track", "mmsi", "time_utc", "latitude_deg", "longitude_deg", "north_m", "east_m", "sog_kn", "cog_deg"];

/// Tracks whose rows are formatted before they are written.
const TRACKS_AT_ONCE: usize = 64;

/// Where tracks come from, and all that is needed to import them again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of searoom that made them.
    pub searoom_version: String,
    /// The files read.
    pub inputs: Vec<InputFile>,
    /// The area kept.
    pub area: Area,
    /// The thresholds used.
    pub thresholds: ImportConfig,
    /// The column mapping, where one was used.
    pub mapping: Option<ColumnMapping>,
    /// The plane of `north_m` and `east_m`.
    pub plane: LocalPlane,
    /// The account of every message.
    pub report: Report,
    /// What is known of each track beside its positions.
    pub tracks: Vec<TrackEntry>,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputFile {
    /// Its path as given.
    pub file: PathBuf,
    /// Its size.
    pub bytes: u64,
}

/// A track's entry in the provenance; its place in the list is its number in `tracks.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackEntry {
    /// Maritime Mobile Service Identity.
    pub mmsi: u32,
    /// Time of its first position, in seconds since 1970-01-01 00:00:00 UTC.
    pub start_unix_s: i64,
    /// Time between two positions.
    pub dt_s: f64,
    /// Its rows.
    pub positions: usize,
    /// What is known of the vessel.
    pub particulars: VesselParticulars,
}

/// Tracks read back from a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackSet {
    /// The tracks, ordered by start and MMSI; positions are rounded to a tenth of a millimetre.
    pub tracks: Vec<Track>,
    /// The plane their positions are on.
    pub plane: LocalPlane,
    /// Where they come from.
    pub provenance: Provenance,
}

/// Writes an import into a folder, which is made where it is missing.
///
/// # Errors
/// Where a file cannot be written; one that stood there before is then unchanged.
pub fn write_import(
    folder: &Path,
    import: &Import,
    files: &[PathBuf],
    area: &Area,
    thresholds: &ImportConfig,
    mapping: Option<&ColumnMapping>,
) -> Result<(), AisError> {
    let provenance = Provenance {
        searoom_version: env!("CARGO_PKG_VERSION").to_owned(),
        inputs: files.iter().map(|file| input_file(file)).collect(),
        area: area.clone(),
        thresholds: thresholds.clone(),
        mapping: mapping.cloned(),
        plane: import.plane,
        report: import.report.clone(),
        tracks: import.tracks.iter().map(TrackEntry::of).collect(),
    };
    write_folder(folder, import, &provenance, |file| file)
}

fn write_folder<W: Write>(
    folder: &Path,
    import: &Import,
    provenance: &Provenance,
    wrap: impl Fn(File) -> W,
) -> Result<(), AisError> {
    let write = |name: &str, fill: &dyn Fn(&mut dyn Write) -> io::Result<()>| {
        atomic_file::write_through(&folder.join(name), &wrap, fill)
    };
    write(TRACKS_CSV, &|out| write_tracks(out, import))?;
    write(BAD_ROWS_CSV, &|out| write_bad_rows(out, &import.bad_rows))?;
    // Last, so that a folder with a provenance has all its tracks.
    write(TRACKS_JSON, &|out| {
        serde_json::to_writer_pretty(&mut *out, provenance)?;
        writeln!(out)
    })?;
    Ok(())
}

fn input_file(file: &Path) -> InputFile {
    // The size only informs: a file that is gone by now was read all the same.
    InputFile { file: file.to_owned(), bytes: std::fs::metadata(file).map_or(0, |data| data.len()) }
}

impl TrackEntry {
    fn of(track: &Track) -> Self {
        Self {
            mmsi: track.mmsi,
            start_unix_s: track.start_unix_s,
            dt_s: track.dt_s,
            positions: track.positions.len(),
            particulars: track.particulars.clone(),
        }
    }
}

fn write_tracks(out: &mut dyn Write, import: &Import) -> io::Result<()> {
    writeln!(out, "{}", COLUMNS.join(","))?;
    for (chunk_index, chunk) in import.tracks.chunks(TRACKS_AT_ONCE).enumerate() {
        let rows: Vec<String> = chunk
            .par_iter()
            .enumerate()
            .map(|(index, track)| rows_of(chunk_index * TRACKS_AT_ONCE + index, track, &import.plane))
            .collect();
        for rows in rows {
            out.write_all(rows.as_bytes())?;
        }
    }
    Ok(())
}

fn rows_of(number: usize, track: &Track, plane: &LocalPlane) -> String {
    let mut rows = String::with_capacity(110 * track.positions.len());
    for (index, position) in track.positions.iter().enumerate() {
        let Position { north_m, east_m } = position;
        let point = plane.unproject(*position);
        let velocity = track.velocity(index);
        // Writing to a string cannot fail.
        let _ = writeln!(
            rows,
            "{number},{},{},{:.7},{:.7},{north_m:.4},{east_m:.4},{:.3},{:.2}",
            track.mmsi,
            iso_utc(track.unix_s(index) as i64),
            point.latitude_deg,
            point.longitude_deg,
            velocity.speed_mps() / MPS_PER_KNOT,
            // What rounds up to a full turn is north.
            (velocity.course().degrees() * 100.0).round() % 36_000.0 / 100.0,
        );
    }
    rows
}

fn write_bad_rows(out: &mut dyn Write, bad_rows: &[BadRow]) -> io::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    rows.write_record(["file", "line", "reason", "excerpt", "remedy"])?;
    for row in bad_rows {
        let (line, reason) = (row.line.to_string(), row.reason.to_string());
        rows.write_record([&row.file, &line, &reason, &row.excerpt, row.reason.remedy()])?;
    }
    rows.flush()
}

/// Reads the tracks that [`write_import`] wrote into a folder.
///
/// # Errors
/// Where the folder does not hold such tracks, or its files do not fit each other.
pub fn load_tracks(folder: &Path) -> Result<TrackSet, AisError> {
    let json = folder.join(TRACKS_JSON);
    let open = |path: &Path| {
        File::open(path).map_err(|source| AisError::Unreadable { file: path.display().to_string(), source })
    };
    let provenance: Provenance = serde_json::from_reader(BufReader::new(open(&json)?)).map_err(|error| {
        AisError::BadTracks { file: json, line: error.line() as u64, problem: error.to_string() }
    })?;
    let csv = folder.join(TRACKS_CSV);
    let tracks = read_tracks(open(&csv)?, &provenance.tracks)
        .map_err(|(line, problem)| AisError::BadTracks { file: csv, line, problem })?;
    Ok(TrackSet { tracks, plane: provenance.plane, provenance })
}

fn read_tracks(text: impl io::Read, entries: &[TrackEntry]) -> Result<Vec<Track>, (u64, String)> {
    let mut rows = csv::ReaderBuilder::new().from_reader(text);
    if rows.headers().map_err(|error| (1, error.to_string()))? != COLUMNS.as_slice() {
        return Err((1, format!("the header is not `{}`", COLUMNS.join(","))));
    }
    let mut tracks: Vec<Track> = entries.iter().map(TrackEntry::empty_track).collect();
    let mut row = csv::StringRecord::new();
    let mut last_line = 1;
    while rows.read_record(&mut row).map_err(|error| (last_line + 1, error.to_string()))? {
        last_line = row.position().map_or(0, csv::Position::line);
        take_row(&row, &mut tracks).map_err(|problem| (last_line, problem))?;
    }
    for (number, (track, entry)) in tracks.iter().zip(entries).enumerate() {
        if track.positions.len() != entry.positions || entry.positions < 2 {
            let (found, expected) = (track.positions.len(), entry.positions);
            return Err((last_line, format!("track {number} has {found} rows instead of {expected}")));
        }
    }
    Ok(tracks)
}

impl TrackEntry {
    fn empty_track(&self) -> Track {
        Track {
            mmsi: self.mmsi,
            start_unix_s: self.start_unix_s,
            dt_s: self.dt_s,
            positions: Vec::new(),
            particulars: self.particulars.clone(),
        }
    }
}

fn take_row(row: &csv::StringRecord, tracks: &mut [Track]) -> Result<(), String> {
    let number: usize = row[0].parse().map_err(|_| format!("`{}` is no track number", &row[0]))?;
    let track = tracks.get_mut(number).ok_or_else(|| format!("track {number} is not in {TRACKS_JSON}"))?;
    let expected_ms = (track.unix_s(track.positions.len()) * 1000.0) as i64;
    if row[1].parse() != Ok(track.mmsi) || TimeForm::Iso.parse(row[2].as_bytes()) != Some(expected_ms) {
        let expected = iso_utc(expected_ms / 1000);
        return Err(format!("expected the position of {} at {expected}", track.mmsi));
    }
    let metres = |column: usize| {
        let value: Option<f64> = row[column].parse().ok();
        value
            .filter(|value| value.is_finite())
            .ok_or_else(|| format!("`{}` is no finite number", &row[column]))
    };
    track.positions.push(Position { north_m: metres(5)?, east_m: metres(6)? });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ais::area::GeoBox;
    use crate::ais::{Counts, Messages, Tracks};
    use crate::atomic_file::tests::FullDisk;

    fn import() -> (Import, Area) {
        let bounds = GeoBox { south_deg: 40.0, north_deg: 41.0, west_deg: -75.0, east_deg: -73.0 };
        let area = Area::of_box("bay", bounds);
        let track = |mmsi: u32, east_m: f64| Track {
            mmsi,
            start_unix_s: 1_600_000_000,
            dt_s: 5.0,
            positions: (0..200).map(|k| Position { north_m: 25.0 * f64::from(k), east_m }).collect(),
            particulars: VesselParticulars { length_m: Some(100.0), ..VesselParticulars::default() },
        };
        let report = Report {
            messages: Messages { read: 0, kept: 0, dropped: Counts::default() },
            tracks: Tracks { found: 2, kept: 2, dropped: Counts::default() },
            cleared_fields: Default::default(),
            splits: Default::default(),
            intervals: Default::default(),
            shared_mmsi: Vec::new(),
            files: Vec::new(),
        };
        let tracks = vec![track(219_000_001, 0.0), track(219_000_002, 1234.5678)];
        (Import { tracks, plane: area.plane(), report, bad_rows: Vec::new() }, area)
    }

    fn write(folder: &Path) -> (Import, Area) {
        let (import, area) = import();
        write_import(folder, &import, &[], &area, &ImportConfig::default(), None).unwrap();
        (import, area)
    }

    #[test]
    fn tracks_come_back_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let (import, area) = write(folder.path());
        let set = load_tracks(folder.path()).unwrap();
        assert_eq!(set.tracks, import.tracks);
        assert_eq!(
            (set.plane, set.provenance.area, set.provenance.report),
            (import.plane, area, import.report)
        );
    }

    #[test]
    fn a_full_disk_leaves_no_half_written_tracks() {
        let folder = tempfile::tempdir().unwrap();
        let (import, _) = write(folder.path());
        let before = std::fs::read(folder.path().join(TRACKS_CSV)).unwrap();
        let provenance = load_tracks(folder.path()).unwrap().provenance;
        let error = write_folder(folder.path(), &import, &provenance, |inner| FullDisk { inner, left: 5000 })
            .unwrap_err();
        assert!(
            error.to_string().contains("tracks.csv") && error.to_string().contains("free some space"),
            "{error}"
        );
        assert_eq!(std::fs::read(folder.path().join(TRACKS_CSV)).unwrap(), before);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn damaged_tracks_are_refused_with_file_and_line() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path());
        let path = folder.path().join(TRACKS_CSV);
        let good = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = good.lines().collect();
        for (damaged, expected) in [
            (lines[..300].join("\n"), "tracks.csv:300: track 1 has 99 rows instead of 200"),
            (good.replace("north_m", "n"), "tracks.csv:1: the header"),
            (lines[..2].join("\n") + "\n" + &lines[3..].join("\n"), "tracks.csv:3: expected the position"),
            (good.replacen("0.0000,0.0000", "nan,0.0000", 1), "`nan` is no finite number"),
        ] {
            std::fs::write(&path, damaged).unwrap();
            let error = load_tracks(folder.path()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        std::fs::write(folder.path().join(TRACKS_JSON), "{\n\"searoom_version\": 1}").unwrap();
        assert!(load_tracks(folder.path()).unwrap_err().to_string().contains("tracks.json:2"));
        let missing = load_tracks(&folder.path().join("nowhere")).unwrap_err().to_string();
        assert!(missing.contains("tracks.json"), "{missing}");
    }
}
