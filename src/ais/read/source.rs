//! Files as streams of text: plain or packed, told apart by their first bytes.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use zip::ZipArchive;

use crate::ais::config::ImportConfig;
use crate::ais::error::AisError;
use crate::ais::format::{ColumnMapping, Layout};
use crate::ais::report::FileReport;

/// How a text is packed into a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// Not at all.
    Plain,
    /// gzip, of one or more members.
    Gzip,
    /// Zstandard.
    Zstd,
    /// The entry of a zip archive at this place.
    ZipEntry(usize),
}

/// A text to import: a file or an archive's entry, whose header was recognised.
#[derive(Debug, Clone)]
pub struct Input {
    /// The file.
    pub path: PathBuf,
    /// Its name in reports.
    pub name: String,
    /// How it is packed.
    pub packing: Packing,
    /// Its columns.
    pub layout: Layout,
    /// Bytes of the file.
    pub file_bytes: u64,
}

/// A file's inputs, and what of it is not read and why.
pub struct Probe {
    /// What to read.
    pub inputs: Vec<Input>,
    /// Entries of an archive that are left out.
    pub left_out: Vec<FileReport>,
}

/// Looks at a file's packing and header.
///
/// # Errors
/// Where it cannot be read that far, is empty, or its header is of no known layout.
pub fn probe(path: &Path, mapping: Option<&ColumnMapping>, config: &ImportConfig) -> Result<Probe, AisError> {
    let name = display_name(path, None);
    let unreadable = |source: io::Error| AisError::Unreadable { file: name.clone(), source };
    let file_bytes = std::fs::metadata(path).map_err(unreadable)?.len();
    let mut left_out = Vec::new();
    let mut inputs = Vec::new();
    for (packing, entry) in packings(path, &name, &mut left_out)? {
        let name = display_name(path, entry.as_deref());
        let unreadable = |source: io::Error| AisError::Unreadable { file: name.clone(), source };
        let header = with_text(path, packing, 0, config, &|_| {}, first_line)
            .and_then(|header| header)
            .map_err(unreadable)?;
        let Some(header) = header else { return Err(AisError::Empty { file: name }) };
        let layout = Layout::recognise(&header, mapping)
            .map_err(|(problem, remedy)| AisError::UnknownHeader { file: name.clone(), problem, remedy })?;
        inputs.push(Input { path: path.to_owned(), name, packing, layout, file_bytes });
    }
    if inputs.is_empty() {
        let problem = "is an archive without any .csv file to read".to_owned();
        return Err(AisError::UnknownHeader {
            file: name,
            problem,
            remedy: "pack the CSV files anew".to_owned(),
        });
    }
    Ok(Probe { inputs, left_out })
}

/// What a file holds, by its first bytes: names say little about what was downloaded.
fn packings(
    path: &Path,
    name: &str,
    left_out: &mut Vec<FileReport>,
) -> Result<Vec<(Packing, Option<String>)>, AisError> {
    let unreadable = |source: io::Error| AisError::Unreadable { file: name.to_owned(), source };
    let mut magic = Vec::new();
    File::open(path).and_then(|file| file.take(4).read_to_end(&mut magic)).map_err(unreadable)?;
    match magic.as_slice() {
        [0x1f, 0x8b, ..] => Ok(vec![(Packing::Gzip, None)]),
        [0x28, 0xb5, 0x2f, 0xfd] => Ok(vec![(Packing::Zstd, None)]),
        [b'P', b'K', 3, 4] | [b'P', b'K', 5, 6] => zip_entries(path, name, left_out).map_err(unreadable),
        _ => Ok(vec![(Packing::Plain, None)]),
    }
}

/// The readable entries of an archive. Nothing is ever unpacked to disk; an entry whose path
/// climbs out of the archive is a sign of tampering and left out.
fn zip_entries(
    path: &Path,
    name: &str,
    left_out: &mut Vec<FileReport>,
) -> io::Result<Vec<(Packing, Option<String>)>> {
    let mut archive = ZipArchive::new(BufReader::new(File::open(path)?)).map_err(io::Error::other)?;
    let mut entries = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(io::Error::other)?;
        let entry_name = entry.name().map_err(io::Error::other)?.into_owned();
        if entry.is_dir() {
            continue;
        }
        let is_text = [".csv", ".txt"].iter().any(|ending| entry_name.to_ascii_lowercase().ends_with(ending));
        let climbs_out = entry.enclosed_name().is_none();
        if is_text && !climbs_out {
            entries.push((Packing::ZipEntry(index), Some(entry_name)));
            continue;
        }
        let damage = climbs_out.then(|| {
            "the entry's path leads out of the archive: not read; get the archive from a source you trust"
                .to_owned()
        });
        let layout = "not read: not a .csv file".to_owned();
        left_out.push(FileReport { file: format!("{name}!{entry_name}"), layout, read: 0, damage });
    }
    Ok(entries)
}

/// Opens a file at `start_byte` (of a plain one; a packed one is read from its beginning) and hands its text to `work`;
/// `on_bytes` hears of bytes of the file as they are used up.
///
/// # Errors
/// Where the file or archive cannot be opened.
pub fn with_text<T>(
    path: &Path,
    packing: Packing,
    start_byte: u64,
    config: &ImportConfig,
    on_bytes: &dyn Fn(u64),
    work: impl FnOnce(&mut dyn Read) -> T,
) -> io::Result<T> {
    let used = Cell::new(0);
    let text = |packed| Text { packed, used: &used, reported: 0, made: 0, config, on_bytes };
    let mut file = File::open(path)?;
    if packing == Packing::Plain {
        file.seek(SeekFrom::Start(start_byte))?;
        return Ok(work(&mut text(&mut Counted { file, used: &used })));
    }
    let mut file = BufReader::with_capacity(1 << 16, Counted { file, used: &used });
    match packing {
        Packing::Plain | Packing::Gzip => Ok(work(&mut text(&mut MultiGzDecoder::new(file)))),
        Packing::Zstd => Ok(work(&mut text(&mut zstd::Decoder::with_buffer(file)?))),
        Packing::ZipEntry(index) => {
            let mut archive = ZipArchive::new(&mut file).map_err(io::Error::other)?;
            let mut entry = archive.by_index(index).map_err(io::Error::other)?;
            Ok(work(&mut text(&mut entry)))
        }
    }
}

/// A file that counts the bytes taken from it.
struct Counted<'c> {
    file: File,
    used: &'c Cell<u64>,
}

impl Read for Counted<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let taken = self.file.read(into)?;
        self.used.set(self.used.get() + taken as u64);
        Ok(taken)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Unpacked text that watches how much it grows.
struct Text<'c> {
    packed: &'c mut dyn Read,
    used: &'c Cell<u64>,
    reported: u64,
    made: u64,
    config: &'c ImportConfig,
    on_bytes: &'c dyn Fn(u64),
}

impl Read for Text<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let fresh = self.packed.read(into)?;
        self.made += fresh as u64;
        let used = self.used.get();
        (self.on_bytes)(used - self.reported);
        self.reported = used;
        let ImportConfig { max_expansion, expansion_checked_from_bytes, .. } = self.config;
        if self.made > *expansion_checked_from_bytes && self.made / max_expansion.max(&1) > used {
            let message = format!(
                "grows by more than {max_expansion} times on unpacking and is taken for a decompression bomb; \
                 raise max_expansion if it is none"
            );
            return Err(io::Error::other(message));
        }
        Ok(fresh)
    }
}

/// The header without its line break; nothing of an empty text. Cut where it is far too long for one.
fn first_line(text: &mut dyn Read) -> io::Result<Option<Vec<u8>>> {
    const MAX_HEADER_BYTES: u64 = 64 << 10;
    let mut line = Vec::new();
    let mut text = BufReader::new(text.take(MAX_HEADER_BYTES));
    io::BufRead::read_until(&mut text, b'\n', &mut line)?;
    if line.is_empty() {
        return Ok(None);
    }
    let end = line.strip_suffix(b"\n").unwrap_or(&line);
    let end = end.strip_suffix(b"\r").unwrap_or(end).len();
    line.truncate(end);
    Ok(Some(line))
}

/// The name under which a file or an archive's entry appears in reports.
fn display_name(path: &Path, entry: Option<&str>) -> String {
    match entry {
        Some(entry) => format!("{}!{entry}", path.display()),
        None => path.display().to_string(),
    }
}
