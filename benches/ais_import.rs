//! Imports an AIS file and prints what it took, as one JSON line; the rivals merely filter its box.
//!
//! `benches/compare ais-import` makes the file, and runs this and them.

use std::path::{Path, PathBuf};
use std::time::Instant;

use searoom::ais::{self, Area, ImportConfig};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<PathBuf> =
        std::env::args_os().skip(1).filter(|argument| argument != "--bench").map(PathBuf::from).collect();
    let [file, area] = files.as_slice() else {
        println!("usage: ais_import FILE AREA.toml; see benches/compare ais-import");
        return Ok(());
    };
    let area = Area::load(area)?;
    let out = tempfile::tempdir()?;

    let start = Instant::now();
    let config = ImportConfig::default();
    let import = ais::import(std::slice::from_ref(file), &area, &config, None, &|_| {})?;
    let read_s = start.elapsed().as_secs_f64();
    ais::write_import(out.path(), &import, std::slice::from_ref(file), &area, &config, None)?;
    let seconds = start.elapsed().as_secs_f64();

    let messages = &import.report.messages;
    let in_box = messages.read - messages.dropped.of(ais::MessageDrop::OutsideArea);
    let result = serde_json::json!({
        "name": "searoom import",
        "seconds": seconds,
        "rows_in_box": in_box,
        "peak_mb": peak_memory_mb(),
        "without_writing_s": read_s,
        "mb_per_s": std::fs::metadata(file)?.len() as f64 / 1e6 / seconds,
        "tracks": import.tracks.len(),
    });
    println!("{result}");
    Ok(())
}

/// The most memory this process ever held, where the system tells (Linux).
fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string(Path::new("/proc/self/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes / 1024.0)
}
