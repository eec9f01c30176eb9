//! The log of a run: one CSV line and one TensorBoard record per entry, cut back on resume.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;

use crate::atomic_file;
use crate::report::event_file::EventWriter;

/// Named values over steps, in a CSV file.
pub struct CsvLog {
    out: BufWriter<File>,
    columns: usize,
}

impl CsvLog {
    /// Opens `path` to go on after `step`: lines of later steps, which a stopped run may have left,
    /// are dropped. The first column is the step.
    pub fn open(path: &Path, header: &str, step: u64) -> anyhow::Result<Self> {
        let old = if step > 0 { std::fs::read_to_string(path).unwrap_or_default() } else { String::new() };
        let kept = old.lines().skip(1).filter(|line| {
            line.split(',').next().and_then(|first| first.parse::<u64>().ok()).is_some_and(|at| at <= step)
        });
        let text: String = std::iter::once(header).chain(kept).flat_map(|line| [line, "\n"]).collect();
        atomic_file::write(path, |out| out.write_all(text.as_bytes()))?;
        let file = OpenOptions::new().append(true).open(path).with_context(|| path.display().to_string())?;
        Ok(Self { out: BufWriter::new(file), columns: header.split(',').count() })
    }

    /// Appends a line; a value that is not known stays empty.
    pub fn write(&mut self, step: u64, values: &[Option<f64>]) -> anyhow::Result<()> {
        debug_assert_eq!(values.len() + 1, self.columns);
        write!(self.out, "{step}")?;
        for value in values {
            match value {
                Some(value) => write!(self.out, ",{value}")?,
                None => write!(self.out, ",")?,
            }
        }
        writeln!(self.out)?;
        Ok(self.out.flush()?)
    }
}

/// A new TensorBoard event file in `folder`, for entries after `step`.
pub fn open_events(folder: &Path, step: u64) -> anyhow::Result<EventWriter<BufWriter<File>>> {
    let path = folder.join(format!("events.out.tfevents.{:010}.searoom.{step}", unix_s() as u64));
    let file = File::create(&path).with_context(|| path.display().to_string())?;
    Ok(EventWriter::new(BufWriter::new(file), unix_s())?)
}

/// The time of day; it goes into event files, never into results.
pub fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}
