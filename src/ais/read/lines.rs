//! The lines of a stream, in blocks that fit the processor's cache.

use std::io::{self, ErrorKind, Read};

use memchr::{memchr, memchr_iter};

/// Bytes read at a time.
const BLOCK_BYTES: usize = 256 << 10;

/// A line without its line break.
#[derive(Debug, PartialEq, Eq)]
pub enum Line<'a> {
    /// The whole of it, empty ones included.
    Whole(&'a [u8]),
    /// The beginning of one that is longer than allowed; the rest was skipped.
    TooLong(&'a [u8]),
}

/// Which lines of a stream to read.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Skip the rest of a line that began before the stream.
    pub starts_inside_line: bool,
    /// Lines that begin at this byte or later belong to somebody else.
    pub until_byte: u64,
}

/// Calls `each` with every line of a stream. Memory stays within `max_line_bytes` and one block,
/// whatever the stream holds.
///
/// # Errors
/// Where reading fails; the whole lines before that have been seen, the broken last one has not.
pub fn for_each_line(
    reader: &mut dyn Read,
    extent: Extent,
    max_line_bytes: usize,
    mut each: impl FnMut(Line<'_>),
) -> io::Result<()> {
    let mut buffer = vec![0; BLOCK_BYTES];
    let mut skipping = extent.starts_inside_line;
    // Bytes in the buffer, and where in the stream it begins.
    let (mut filled, mut offset) = (0, 0_u64);
    loop {
        let fresh = read_some(reader, &mut buffer[filled..])?;
        let at_end = fresh == 0;
        filled += fresh;

        let mut start = 0;
        if skipping {
            match memchr(b'\n', &buffer[..filled]) {
                Some(newline) => (start, skipping) = (newline + 1, false),
                None => start = filled,
            }
        }
        let base = start;
        for newline in memchr_iter(b'\n', &buffer[base..filled]) {
            if offset + start as u64 >= extent.until_byte {
                return Ok(());
            }
            each(bounded(&buffer[start..base + newline], max_line_bytes));
            start = base + newline + 1;
        }
        if offset + start as u64 >= extent.until_byte {
            return Ok(());
        }
        if at_end {
            if start < filled {
                each(bounded(&buffer[start..filled], max_line_bytes));
            }
            return Ok(());
        }

        buffer.copy_within(start..filled, 0);
        offset += start as u64;
        filled -= start;
        if filled > max_line_bytes {
            each(Line::TooLong(beginning(&buffer, max_line_bytes)));
            offset += filled as u64;
            (filled, skipping) = (0, true);
        } else if filled == buffer.len() {
            buffer.resize((2 * filled).min(max_line_bytes + 1), 0);
        }
    }
}

fn bounded(line: &[u8], max_line_bytes: usize) -> Line<'_> {
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    if line.len() > max_line_bytes {
        Line::TooLong(beginning(line, max_line_bytes))
    } else {
        Line::Whole(line)
    }
}

fn beginning(line: &[u8], max_line_bytes: usize) -> &[u8] {
    &line[..max_line_bytes.min(80)]
}

fn read_some(reader: &mut dyn Read, into: &mut [u8]) -> io::Result<usize> {
    loop {
        match reader.read(into) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            outcome => return outcome,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ALL: Extent = Extent { starts_inside_line: false, until_byte: u64::MAX };

    fn lines(text: &[u8], extent: Extent, max: usize) -> Vec<(bool, Vec<u8>)> {
        let mut all = Vec::new();
        for_each_line(&mut &text[..], extent, max, |line| {
            all.push(match line {
                Line::Whole(text) => (true, text.to_vec()),
                Line::TooLong(text) => (false, text.to_vec()),
            });
        })
        .unwrap();
        all
    }

    #[test]
    fn line_breaks_of_both_kinds_end_a_line() {
        let found = lines(b"a\r\nb\n\nc", ALL, 100);
        let expected = ["a", "b", "", "c"].map(|line| (true, line.as_bytes().to_vec()));
        assert_eq!(found, expected);
    }

    #[test]
    fn a_line_of_ten_megabytes_is_skipped_and_the_next_is_read() {
        let text = [&b"first\n"[..], &vec![b'x'; 10 << 20], b"\nlast\n"].concat();
        let found = lines(&text, ALL, 1 << 20);
        assert_eq!(found.len(), 3);
        assert!(!found[1].0);
        assert_eq!(found[2], (true, b"last".to_vec()));
    }

    #[test]
    fn what_was_read_before_a_failure_is_kept() {
        struct Broken<'a>(&'a [u8]);
        impl Read for Broken<'_> {
            fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
                if self.0.is_empty() { Err(io::Error::other("broken")) } else { self.0.read(into) }
            }
        }
        let mut seen = 0;
        for_each_line(&mut Broken(b"one\ntwo\nthr"), ALL, 100, |_| seen += 1).unwrap_err();
        assert_eq!(seen, 2);
    }

    proptest! {
        /// Every line is read once, by the part in which it begins.
        #[test]
        fn parts_of_a_file_read_all_its_lines_once(
            text in "[a-c\n]{0,60}", cut in 0..60_usize,
        ) {
            let cut = cut.min(text.len());
            let whole = lines(text.as_bytes(), ALL, 10);
            let mut parts = lines(text.as_bytes(), Extent { starts_inside_line: false, until_byte: cut as u64 }, 10);
            if cut > 0 {
                let extent = Extent { starts_inside_line: true, until_byte: u64::MAX };
                parts.extend(lines(&text.as_bytes()[cut - 1..], extent, 10));
            } else {
                parts = whole.clone();
            }
            prop_assert_eq!(whole, parts);
        }
    }
}
