//! Files that are either written whole or not touched: a temporary file in the same folder, then
//! a rename.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file could not be written; whatever stood there before is unchanged.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {} ({source}): free some space or choose a folder that can be written to", path.display())]
pub struct WriteError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

/// Writes a file whole: `fill` writes the content to a buffered temporary file beside it, which
/// then takes its place. Missing folders above it are made.
///
/// # Errors
/// Where the disk is full, the folder cannot be written to, or `fill` fails. The old file then
/// stands as it was and the temporary file is gone.
pub fn write(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    write_through(path, |file| file, fill)
}

/// As [`write`](fn@write), through a writer that `wrap` puts around the file: a compressor, a
/// counter, or a disk that fills up in a test.
///
/// # Errors
/// As [`write`](fn@write).
pub fn write_through<W: Write>(
    path: &Path,
    wrap: impl FnOnce(File) -> W,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    write_whole(path, wrap, fill).map_err(|source| WriteError { path: path.to_owned(), source })
}

/// How names of temporary files begin and end.
const UNFINISHED: (&str, &str) = (".", ".partial");

/// Whether a file is one that was never put in place: its process was killed, or is still writing.
#[must_use]
pub fn is_unfinished(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy());
    name.is_some_and(|name| name.starts_with(UNFINISHED.0) && name.ends_with(UNFINISHED.1))
}

fn write_whole<W: Write>(
    path: &Path,
    wrap: impl FnOnce(File) -> W,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED.0).suffix(UNFINISHED.1);
    // The default of `tempfile` shuts out everybody else; a result is an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let temporary = builder.tempfile_in(folder)?;

    let mut writer = BufWriter::with_capacity(1 << 16, wrap(temporary.as_file().try_clone()?));
    fill(&mut writer)?;
    writer.flush()?;
    drop(writer);
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|error| error.error)?;
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A disk with room for `left` more bytes.
    pub(crate) struct FullDisk<W> {
        pub(crate) inner: W,
        pub(crate) left: usize,
    }

    impl<W: Write> Write for FullDisk<W> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.left == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let written = self.inner.write(&bytes[..bytes.len().min(self.left)])?;
            self.left -= written;
            Ok(written)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.inner.flush()
        }
    }

    #[test]
    fn a_full_disk_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tracks.csv");
        write(&path, |out| out.write_all(b"old")).unwrap();

        let error = write_through(
            &path,
            |inner| FullDisk { inner, left: 1000 },
            |out| out.write_all(&vec![b'x'; 1_000_000]),
        )
        .unwrap_err();

        assert!(error.to_string().contains("tracks.csv"), "{error}");
        assert!(error.to_string().contains("free some space"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn missing_folders_are_made_and_old_content_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/result.json");
        for content in ["first", "second"] {
            write(&path, |out| out.write_all(content.as_bytes())).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), content);
        }
    }

    #[test]
    fn a_file_is_unfinished_until_it_is_put_in_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        write(&path, |out| {
            out.write_all(b"half")?;
            let entries = std::fs::read_dir(folder.path())?.flatten();
            assert!(entries.map(|entry| entry.path()).all(|path| is_unfinished(&path)));
            Ok(())
        })
        .unwrap();
        assert!(!is_unfinished(&path) && !is_unfinished(folder.path()));
    }

    #[test]
    fn a_failure_half_way_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        write(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("interrupted"))
        })
        .unwrap_err();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
