//! A value that cannot be: which key, and where in the file it stands.

use std::collections::BTreeMap;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use super::ConfigError;

/// What is wrong with what was asked for.
///
/// The key is a path: `own_ship.course_deg`, or `target[2].dcpa_m` for the second `[[target]]`
/// (lists count from 1, as people do).
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}; {remedy}")]
pub struct Fault {
    /// Path of the key at fault.
    pub key: String,
    /// What is the matter.
    pub message: String,
    /// What to write instead.
    pub remedy: String,
}

impl Fault {
    /// A fault of one key.
    pub fn new(key: impl Into<String>, message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into(), remedy: remedy.into() }
    }

    /// The same fault seen from the section that holds the key.
    #[must_use]
    pub fn within(self, path: &str) -> Self {
        Self { key: join(path, &self.key), ..self }
    }
}

/// The path of `key` in the table `path`.
pub fn join(path: &str, key: &str) -> String {
    match (path, key) {
        ("", key) => key.to_owned(),
        (path, "") => path.to_owned(),
        (path, key) => format!("{path}.{key}"),
    }
}

/// The line of every key of a document and of every table, by path.
#[derive(Debug, Clone)]
pub struct KeyLines(BTreeMap<String, usize>);

impl KeyLines {
    /// Of a document and its text.
    pub fn new(text: &str, document: &DeTable<'_>) -> Self {
        let starts: Vec<usize> = std::iter::once(0)
            .chain(text.bytes().zip(1..).filter_map(|(byte, next)| (byte == b'\n').then_some(next)))
            .collect();
        let mut lines = BTreeMap::new();
        let line = |offset: usize| starts.partition_point(|start| *start <= offset);
        collect("", document, &line, &mut lines);
        Self(lines)
    }

    /// The line of a key, or of the nearest table around it.
    fn line_of(&self, key: &str) -> usize {
        let mut path = key;
        loop {
            if let Some(line) = self.0.get(path) {
                return *line;
            }
            match path.rfind(['.', '[']) {
                Some(end) => path = &path[..end],
                None => return 1,
            }
        }
    }

    /// Says where in the document, which is that of `file`, a fault is.
    pub fn located(&self, file: &Path, fault: Fault) -> ConfigError {
        let key = self.as_written(&fault.key);
        ConfigError {
            file: file.to_owned(),
            line: Some(self.line_of(&key)),
            key: Some(key),
            message: fault.message,
            remedy: fault.remedy,
        }
    }

    /// The key as it is written in the file, where a fault names the same quantity in another unit.
    fn as_written(&self, key: &str) -> String {
        let quantity = |key: &str| key.rsplit_once('_').map(|(quantity, _)| quantity.to_owned());
        let Some(wanted) = quantity(key).filter(|_| !self.0.contains_key(key)) else {
            return key.to_owned();
        };
        let written = self.0.keys().find(|other| quantity(other).as_ref() == Some(&wanted));
        written.map_or(key, String::as_str).to_owned()
    }
}

fn collect(
    path: &str,
    table: &DeTable<'_>,
    line: &impl Fn(usize) -> usize,
    lines: &mut BTreeMap<String, usize>,
) {
    for (key, value) in table {
        let path = join(path, key.get_ref());
        lines.insert(path.clone(), line(key.span().start));
        match value.get_ref() {
            DeValue::Table(inner) => collect(&path, inner, line, lines),
            DeValue::Array(list) => {
                for (index, item) in list.iter().enumerate() {
                    let path = format!("{path}[{}]", index + 1);
                    lines.insert(path.clone(), line(item.span().start));
                    if let DeValue::Table(inner) = item.get_ref() {
                        collect(&path, inner, line, lines);
                    }
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_knows_its_line() {
        let source =
            "a = 1\n\n[own]\nb = 2\n\n[[target]]\nc = 1\n[[target]]\nd = [ { e = 1 },\n { e = 2 } ]\n";
        let document = DeTable::parse(source).unwrap();
        let lines = KeyLines::new(source, document.get_ref());
        for (key, line) in [
            ("a", 1),
            ("own", 3),
            ("own.b", 4),
            ("target[1]", 6),
            ("target[1].c", 7),
            ("target[2]", 8),
            ("target[2].d[2].e", 10),
            ("target[2].missing", 8),
            ("nowhere", 1),
        ] {
            assert_eq!(lines.line_of(key), line, "{key}");
        }
    }
}
