//! `searoom ais`: recorded traffic to tracks, their summary, and their picture.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Subcommand;

use super::{progress, table};
use crate::ais::{self, Area, ColumnMapping, Counts, Import, ImportConfig, Reason, Report, TrackSet};
use crate::geo::{M_PER_NMI, MPS_PER_KNOT};
use crate::report::map;

/// Bad rows that are shown after an import; the others are in a file.
const BAD_ROWS_SHOWN: usize = 5;

const EXAMPLES: &str = "\
Examples:
  The shipped recording of New York harbour, to tracks in the Lower Bay:
    searoom ais import ais/ny-harbor-2020-12.csv.gz --area ais/ny-lower-bay.toml --out out/ny
  A month of Danish daily files, read side by side; the report as JSON:
    searoom ais import aisdk-2022-11-*.zip --area ais/danish-north-sea.toml --out out/dk --json
  Look at what came out:
    searoom ais summary out/ny
    searoom ais plot out/ny --out map.svg";

/// Arguments of `searoom ais`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Read AIS files and write the tracks inside an area
    ///
    /// Layouts are told apart by their header: daily files of the Danish Maritime Authority, NOAA MarineCadastre (both of its
    /// headers), and with --mapping any other CSV. Files may be plain, .gz, .zst or .zip.
    /// Every message is accounted for: kept, or dropped for one reason.
    #[command(after_help = EXAMPLES)]
    Import(ImportArgs),
    /// Show what a folder of tracks holds and where it came from
    Summary {
        /// Folder that `ais import` wrote
        dir: PathBuf,
        /// Print the provenance as JSON instead
        #[arg(long)]
        json: bool,
    },
    /// Draw the tracks of a folder on a map, coloured by speed
    Plot {
        /// Folder that `ais import` wrote
        dir: PathBuf,
        /// The SVG file to write
        #[arg(long, value_name = "FILE.svg")]
        out: PathBuf,
    },
}

#[derive(Debug, clap::Args)]
struct ImportArgs {
    /// AIS files; all are looked at as one recording
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The area, time window and filters
    #[arg(long, value_name = "FILE.toml", default_value = "ais/ny-lower-bay.toml")]
    area: PathBuf,
    /// Folder for tracks.csv, tracks.json and bad_rows.csv
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Columns of a layout that is not known
    #[arg(long, value_name = "FILE.toml")]
    mapping: Option<PathBuf>,
    /// Thresholds of cleaning, splitting and resampling that differ from the defaults
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Runs `searoom ais`.
///
/// # Errors
/// Where files cannot be read or written, or are not what they should be.
pub fn run(args: Args, out: &mut dyn Write) -> anyhow::Result<()> {
    match args.command {
        Command::Import(args) => import(&args, out),
        Command::Summary { dir, json } => summary(&dir, json, out),
        Command::Plot { dir, out: file } => {
            let set = ais::load_tracks(&dir)?;
            let drawn = map::draw(&set.tracks, &set.plane, &set.provenance.area);
            crate::atomic_file::write(&file, |svg| svg.write_all(drawn.as_bytes()))?;
            writeln!(out, "{} drawn on {}", counted(set.tracks.len(), "track"), file.display())?;
            Ok(())
        }
    }
}

fn import(args: &ImportArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let area = Area::load(&args.area)?;
    let mapping = args.mapping.as_deref().map(ColumnMapping::load).transpose()?;
    let config = args.config.as_deref().map(ImportConfig::load).transpose()?.unwrap_or_default();
    // A file that is not there is reported by the import itself.
    let total = args.files.iter().filter_map(|file| Some(std::fs::metadata(file).ok()?.len())).sum();
    let bar = progress::bytes(total, "reading");
    let import = ais::import(&args.files, &area, &config, mapping.as_ref(), &|bytes| bar.inc(bytes))?;
    bar.finish_and_clear();
    ais::write_import(&args.out, &import, &args.files, &area, &config, mapping.as_ref())?;

    if args.json {
        let Report { messages, tracks, .. } = &import.report;
        writeln!(out, "{}", serde_json::json!({ "messages": messages, "tracks": tracks }))?;
    } else {
        write_report(&import.report, out)?;
        writeln!(
            out,
            "{} of {} written to {}",
            counted(import.tracks.len(), "track"),
            area.name,
            args.out.display()
        )?;
    }
    warn(&import, &args.out)
}

/// Tells on standard error what is wrong with the input. A damaged file makes the command fail,
/// after what could be read was written.
fn warn(import: &Import, dir: &Path) -> anyhow::Result<()> {
    for row in import.bad_rows.iter().take(BAD_ROWS_SHOWN) {
        eprintln!("warning: {row}");
    }
    let bad_rows: u64 =
        import.report.messages.dropped.iter().filter(|(why, _)| why.is_bad_row()).map(|(_, n)| n).sum();
    if bad_rows > BAD_ROWS_SHOWN as u64 {
        eprintln!("warning: {bad_rows} bad rows in all: see {}", dir.join("bad_rows.csv").display());
    }
    let damaged: Vec<String> =
        import.report.damaged_files().map(|(file, damage)| format!("{file}: {damage}")).collect();
    if !damaged.is_empty() {
        bail!("{}; the rest was imported", damaged.join("; "));
    }
    Ok(())
}

fn write_report(report: &Report, out: &mut dyn Write) -> anyhow::Result<()> {
    let mut files = table::table(2, &["file", "layout", "messages"]);
    for file in &report.files {
        files.add_row([file.file.clone(), file.layout.clone(), table::grouped(file.read)]);
    }
    writeln!(out, "{files}")?;
    let (messages, tracks) = (&report.messages, &report.tracks);
    writeln!(out, "{}", counts_table("messages", messages.read, messages.kept, &messages.dropped))?;
    writeln!(out, "{}", counts_table("trajectories", tracks.found, tracks.kept, &tracks.dropped))?;
    if !report.shared_mmsi.is_empty() {
        let list: Vec<String> = report.shared_mmsi.iter().map(u32::to_string).collect();
        writeln!(out, "Two vessels at a time under one MMSI, split into two tracks: {}", list.join(", "))?;
    }
    Ok(())
}

fn counts_table<R: Reason + std::fmt::Display>(
    what: &str,
    all: u64,
    kept: u64,
    dropped: &Counts<R>,
) -> comfy_table::Table {
    let mut table = table::table(1, &[what, "count"]);
    table.add_row(["all".to_owned(), table::grouped(all)]);
    table.add_row(["kept".to_owned(), table::grouped(kept)]);
    for (reason, many) in dropped.iter() {
        table.add_row([reason.to_string().replace('_', " "), table::grouped(many)]);
    }
    table
}

fn summary(dir: &Path, json: bool, out: &mut dyn Write) -> anyhow::Result<()> {
    let set = ais::load_tracks(dir)?;
    if json {
        serde_json::to_writer_pretty(&mut *out, &set.provenance)?;
        writeln!(out)?;
        return Ok(());
    }
    let TrackSet { tracks, provenance, .. } = &set;
    writeln!(
        out,
        "{}: {} tracks, searoom {}",
        provenance.area.name,
        tracks.len(),
        provenance.searoom_version
    )?;
    write_report(&provenance.report, out)?;

    let mut vessels: Vec<u32> = tracks.iter().map(|track| track.mmsi).collect();
    vessels.sort_unstable();
    vessels.dedup();
    let mut figures = table::table(1, &["tracks", "least", "median", "most"]);
    let mut row = |name: &str, unit: f64, decimals: usize, value: &dyn Fn(&crate::track::Track) -> f64| {
        let mut values: Vec<f64> = tracks.iter().map(|track| value(track) / unit).collect();
        values.sort_by(f64::total_cmp);
        let at = |fraction: f64| values.get((fraction * (values.len().max(1) - 1) as f64).round() as usize);
        let show = |value: Option<&f64>| value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"));
        figures.add_row([name.to_owned(), show(at(0.0)), show(at(0.5)), show(at(1.0))]);
    };
    row("duration (min)", 60.0, 0, &|track| track.duration_s());
    row("length (nmi)", M_PER_NMI, 1, &|track| track.path_length_m());
    row("mean speed (kn)", MPS_PER_KNOT, 1, &|track| track.path_length_m() / track.duration_s());
    writeln!(out, "{figures}")?;
    let first = tracks.iter().map(|track| track.start_unix_s).min();
    let last = tracks.iter().map(|track| track.unix_s(track.positions.len() - 1) as i64).max();
    if let (Some(first), Some(last)) = (first, last) {
        let (first, last) = (ais::iso_utc(first), ais::iso_utc(last));
        writeln!(out, "{} from {first} to {last}", counted(vessels.len(), "vessel"))?;
    }
    Ok(())
}

fn counted(many: usize, what: &str) -> String {
    format!("{many} {what}{}", if many == 1 { "" } else { "s" })
}
