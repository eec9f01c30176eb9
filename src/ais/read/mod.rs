//! Reading: files to messages inside the area, several files and parts of files side by side.

use std::collections::HashMap;
use std::path::PathBuf;

use rayon::prelude::*;

use super::area::Area;
use super::config::ImportConfig;
use super::error::AisError;
use super::format::ColumnMapping;
use super::message::Message;
use super::report::{BadRow, ClearedFields, Counts, FileReport, MessageDrop};
use crate::track::VesselParticulars;

pub(crate) mod lines;
pub(crate) mod number;
pub(crate) mod row;
pub(crate) mod source;
pub(crate) mod time;

use lines::{Extent, Line, for_each_line};
use row::RowReader;
use source::{Input, Packing, Probe, probe, with_text};

/// Bytes of a plain file that one task reads.
const PART_BYTES: u64 = 16 << 20;

/// Characters of a bad row that are shown.
const EXCERPT_CHARS: usize = 60;

/// Hears of bytes of the input files as they are used up, from any thread.
pub type Progress<'p> = &'p (dyn Fn(u64) + Sync);

/// What was read, before cleaning.
#[derive(Debug, Default)]
pub struct Reading {
    /// Messages inside the area, in the order of files and lines.
    pub messages: Vec<Message>,
    /// What is known of their senders.
    pub vessels: HashMap<u32, VesselParticulars>,
    /// Rows that are no such message, by reason.
    pub dropped: Counts<MessageDrop>,
    /// Optional fields cleared.
    pub cleared: ClearedFields,
    /// The first bad rows, in the order of files and lines.
    pub bad_rows: Vec<BadRow>,
    /// The account of each file.
    pub files: Vec<FileReport>,
}

/// A stretch of an input that one task reads: the lines that begin in it.
struct Part<'i> {
    input: &'i Input,
    from_byte: u64,
    until_byte: u64,
}

/// What a task found in its part.
struct Scan<'i> {
    input: &'i Input,
    lines: u64,
    read: u64,
    messages: Vec<Message>,
    vessels: HashMap<u32, VesselParticulars>,
    dropped: Counts<MessageDrop>,
    cleared: ClearedFields,
    bad_rows: Vec<(u64, MessageDrop, String)>,
    damage: Option<String>,
}

/// Reads all files, keeping the messages inside the area.
///
/// # Errors
/// Where a file cannot be opened or its header is not recognised; that is found out before
/// anything is read.
pub fn read_files(
    files: &[PathBuf],
    area: &Area,
    config: &ImportConfig,
    mapping: Option<&ColumnMapping>,
    progress: Progress<'_>,
) -> Result<Reading, AisError> {
    if files.is_empty() {
        return Err(AisError::NoFiles);
    }
    let probes: Vec<Probe> =
        files.par_iter().map(|file| probe(file, mapping, config)).collect::<Result<_, _>>()?;
    let parts: Vec<Part<'_>> = probes.iter().flat_map(|probe| &probe.inputs).flat_map(parts_of).collect();
    // One part per task: the pool takes them in order, so that a file is read once from front to back.
    let scans: Vec<Scan<'_>> =
        parts.par_iter().with_max_len(1).map(|part| scan(part, area, config, progress)).collect();

    let mut reading = Reading::default();
    for of_one_input in scans.chunk_by(|a, b| std::ptr::eq(a.input, b.input)) {
        reading.append(of_one_input, config);
    }
    reading.messages = concat(scans.into_iter().map(|scan| scan.messages));
    reading.files.extend(probes.into_iter().flat_map(|probe| probe.left_out));
    Ok(reading)
}

fn parts_of(input: &Input) -> Vec<Part<'_>> {
    if input.packing != Packing::Plain {
        return vec![Part { input, from_byte: 0, until_byte: u64::MAX }];
    }
    let count = input.file_bytes.div_ceil(PART_BYTES).max(1);
    (0..count)
        .map(|index| Part {
            input,
            from_byte: index * PART_BYTES,
            // Whatever is appended while we read belongs to the last part.
            until_byte: if index + 1 == count { u64::MAX } else { (index + 1) * PART_BYTES },
        })
        .collect()
}

fn scan<'i>(part: &Part<'i>, area: &Area, config: &ImportConfig, progress: Progress<'_>) -> Scan<'i> {
    let input = part.input;
    let mut scan = Scan::of(input);
    let mut rows = RowReader::new(&input.layout, area, config);
    // One byte early: if it is a line break, the part begins with a line.
    let start_byte = part.from_byte.saturating_sub(1);
    let extent = Extent {
        starts_inside_line: part.from_byte > 0,
        until_byte: part.until_byte.saturating_sub(start_byte),
    };
    let has_header = part.from_byte == 0;
    let outcome = with_text(&input.path, input.packing, start_byte, config, progress, |text| {
        for_each_line(text, extent, config.max_line_bytes, |line| {
            scan.lines += 1;
            if !(has_header && scan.lines == 1) {
                scan.take(&line, &mut rows, config);
            }
        })
    });
    if let Err(error) = outcome.and_then(|read| read) {
        scan.damage = Some(error.to_string());
    }
    (scan.cleared, scan.vessels) = (rows.cleared, rows.vessels);
    scan
}

impl<'i> Scan<'i> {
    fn of(input: &'i Input) -> Self {
        Self {
            input,
            lines: 0,
            read: 0,
            messages: Vec::new(),
            vessels: HashMap::new(),
            dropped: Counts::default(),
            cleared: ClearedFields::default(),
            bad_rows: Vec::new(),
            damage: None,
        }
    }

    #[inline]
    fn take(&mut self, line: &Line<'_>, rows: &mut RowReader<'_>, config: &ImportConfig) {
        let (outcome, text) = match *line {
            Line::Whole([]) => return,
            Line::Whole(text) => (rows.read(text), text),
            Line::TooLong(beginning) => (Err(MessageDrop::LineTooLong), beginning),
        };
        self.read += 1;
        match outcome {
            Ok(message) => self.messages.push(message),
            Err(reason) => {
                self.dropped.add(reason, 1);
                if reason.is_bad_row() && self.bad_rows.len() < config.max_bad_rows_listed {
                    self.bad_rows.push((self.lines, reason, excerpt(text)));
                }
            }
        }
    }
}

/// The beginning of a row in printable characters.
fn excerpt(text: &[u8]) -> String {
    let text = &text[..text.len().min(4 * EXCERPT_CHARS)];
    let printable = String::from_utf8_lossy(text).replace(char::is_control, "\u{fffd}");
    printable.chars().take(EXCERPT_CHARS).collect()
}

impl Reading {
    /// Adds the account of one input, of which the parts come in order.
    fn append(&mut self, parts: &[Scan<'_>], config: &ImportConfig) {
        let Some(input) = parts.first().map(|part| part.input) else { return };
        let (mut lines_before, mut damage) = (0, None);
        for part in parts {
            self.dropped.merge(&part.dropped);
            self.cleared.sog += part.cleared.sog;
            self.cleared.cog += part.cleared.cog;
            self.cleared.heading += part.cleared.heading;
            for (&mmsi, particulars) in &part.vessels {
                fill_in(self.vessels.entry(mmsi).or_default(), particulars);
            }
            let room = config.max_bad_rows_listed - self.bad_rows.len().min(config.max_bad_rows_listed);
            self.bad_rows.extend(part.bad_rows.iter().take(room).map(|(line, reason, excerpt)| BadRow {
                file: input.name.clone(),
                line: lines_before + line,
                reason: *reason,
                excerpt: excerpt.clone(),
            }));
            lines_before += part.lines;
            let broken = part.damage.as_ref().map(|error| {
                let remedy = "the rest of it is lost; fetch the file again";
                format!("breaks off after line {lines_before} ({error}): {remedy}")
            });
            damage = damage.or(broken);
        }
        self.files.push(FileReport {
            file: input.name.clone(),
            layout: input.layout.name.clone(),
            read: parts.iter().map(|part| part.read).sum(),
            damage,
        });
    }
}

/// Takes from `more` what is not known yet.
fn fill_in(known: &mut VesselParticulars, more: &VesselParticulars) {
    known.length_m = known.length_m.or(more.length_m);
    known.beam_m = known.beam_m.or(more.beam_m);
    known.ship_type = known.ship_type.take().or_else(|| more.ship_type.clone());
}

/// One list of several, without holding more than a part of them twice.
fn concat(lists: impl Iterator<Item = Vec<Message>>) -> Vec<Message> {
    lists.fold(Vec::new(), |mut all, mut list| {
        if all.is_empty() {
            return list;
        }
        all.append(&mut list);
        all
    })
}
