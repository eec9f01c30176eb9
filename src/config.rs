//! TOML files a person writes, read into plain structs; every error names file, line, key and
//! remedy.
//!
//! What the type already says (unknown keys, wrong types, missing keys) is checked here. What only
//! the reader knows (a box upside down, a track that is not there) is reported by the reader
//! through [`Source::error_at`], with the span of a [`toml::Spanned`] field, or as a [`Fault`], which
//! [`Source::located`] finds in the text.

pub(crate) mod bounds;
mod fault;

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::de::DeTable;

pub use bounds::{BoundedNumber, check_bounds};
pub(crate) use fault::join;
pub use fault::{Fault, KeyLines};

/// What is wrong in a configuration file, where, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}{}{}{message}: {remedy}",
    file.display(),
    line.map_or_else(|| ": ".into(), |line| format!(":{line}: ")),
    key.as_ref().map_or_else(String::new, |key| format!("key \"{key}\": ")))]
pub struct ConfigError {
    /// The file as the caller named it.
    pub file: PathBuf,
    /// Line of the fault, counted from 1; nothing where the file could not be read at all.
    pub line: Option<usize>,
    /// The key at fault, where there is one.
    pub key: Option<String>,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub remedy: String,
}

/// The text of a configuration file together with its name.
#[derive(Debug, Clone)]
pub struct Source {
    /// The file as the caller named it.
    pub file: PathBuf,
    /// Its whole text.
    pub text: String,
}

impl Source {
    /// Text that is already in memory; `file` only names it in errors.
    pub fn new(file: impl Into<PathBuf>, text: impl Into<String>) -> Self {
        Self { file: file.into(), text: text.into() }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// Where the file is missing, unreadable or not UTF-8.
    pub fn read(file: &Path) -> Result<Self, ConfigError> {
        let unreadable = |message: String, remedy: &str| ConfigError {
            file: file.to_owned(),
            line: None,
            key: None,
            message,
            remedy: remedy.to_owned(),
        };
        let bytes = std::fs::read(file).map_err(|error| {
            unreadable(format!("cannot be read ({error})"), "check the path and its permissions")
        })?;
        let text = String::from_utf8(bytes)
            .map_err(|error| unreadable(format!("is not text ({error})"), "save it as UTF-8"))?;
        Ok(Self::new(file, text))
    }

    /// Reads the text as a `T`, which should deny unknown fields.
    ///
    /// # Errors
    /// On a syntax error, an unknown or missing key, or a value of the wrong type.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, ConfigError> {
        toml::from_str(&self.text).map_err(|error| self.explain(&error))
    }

    /// An error about the part of the text that `span` covers, as a [`toml::Spanned`] reports it.
    pub fn error_at(
        &self,
        span: Range<usize>,
        key: &str,
        message: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ConfigError {
        ConfigError {
            file: self.file.clone(),
            line: Some(self.line_of(span.start)),
            key: Some(key.to_owned()),
            message: message.into(),
            remedy: remedy.into(),
        }
    }

    /// The text as a TOML document, and the lines of its keys.
    ///
    /// # Errors
    /// On a syntax error.
    pub fn document(&self) -> Result<(DeTable<'_>, KeyLines), ConfigError> {
        let document = DeTable::parse(&self.text).map_err(|error| ConfigError {
            file: self.file.clone(),
            line: Some(error.span().map_or(1, |span| self.line_of(span.start))),
            key: None,
            message: error.message().replace('\n', ", "),
            remedy: "correct the TOML here".to_owned(),
        })?;
        let document = document.into_inner();
        let lines = KeyLines::new(&self.text, &document);
        Ok((document, lines))
    }

    /// Says where in the text a fault is.
    pub fn located(&self, fault: Fault) -> ConfigError {
        match self.document() {
            Ok((_, lines)) => lines.located(&self.file, fault),
            Err(error) => error,
        }
    }

    /// The line, counted from 1, on which byte `offset` stands.
    pub fn line_of(&self, offset: usize) -> usize {
        let before = &self.text.as_bytes()[..offset.min(self.text.len())];
        1 + before.iter().filter(|&&byte| byte == b'\n').count()
    }

    fn explain(&self, error: &toml::de::Error) -> ConfigError {
        let raw = error.message();
        let span = error.span().unwrap_or(0..0);
        let (key, message, remedy) = if let Some(name) = quoted_after(raw, "unknown field ") {
            (None, format!("unknown key \"{name}\""), suggest(name, raw))
        } else if let Some(name) = quoted_after(raw, "unknown variant ") {
            (self.key_at(&span), format!("unknown value \"{name}\""), suggest(name, raw))
        } else if let Some(name) = quoted_after(raw, "missing field ") {
            let remedy = format!("add `{name} = ...` to this table");
            (None, format!("key \"{name}\" is missing"), remedy)
        } else if let Some((found, expected)) = raw.strip_prefix("invalid type: ").and_then(split_expected) {
            (
                self.key_at(&span),
                format!("{found} is of the wrong type"),
                format!("write {}", plain_type(expected)),
            )
        } else if let Some((found, expected)) = raw.strip_prefix("invalid value: ").and_then(split_expected) {
            (self.key_at(&span), format!("{found} does not fit"), format!("write {}", plain_type(expected)))
        } else {
            (self.key_at(&span), raw.to_owned(), "correct the TOML here".to_owned())
        };
        let line = Some(self.line_of(span.start));
        ConfigError { file: self.file.clone(), line, key, message, remedy }
    }

    /// The key whose value starts the span: what stands before `=` on its line.
    fn key_at(&self, span: &Range<usize>) -> Option<String> {
        let start = span.start.min(self.text.len());
        let line_start =
            self.text.as_bytes()[..start].iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
        let (before, _) = self.text.get(line_start..)?.lines().next()?.split_once('=')?;
        let key = before.trim().trim_matches('"');
        (!key.is_empty() && !key.contains(['[', '{', '#'])).then(|| key.to_owned())
    }
}

/// Reads a TOML file as a `T`.
///
/// # Errors
/// As [`Source::read`] and [`Source::parse`].
pub fn load<T: DeserializeOwned>(file: &Path) -> Result<T, ConfigError> {
    Source::read(file)?.parse()
}

/// Reads a TOML file as a `T` and checks what it says; a fault is found in the text.
///
/// # Errors
/// As [`load`], and as `check`.
pub fn load_checked<T: DeserializeOwned>(
    file: &Path,
    check: impl FnOnce(&T) -> Result<(), Fault>,
) -> Result<T, ConfigError> {
    let source = Source::read(file)?;
    let value = source.parse()?;
    check(&value).map_err(|fault| source.located(fault))?;
    Ok(value)
}

/// Points from a word that is not known to the nearest that is, or lists them.
pub fn did_you_mean<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    // Jaro-Winkler weighs a common beginning, as a key without its unit has.
    let nearest = known
        .iter()
        .map(|&candidate| (strsim::jaro_winkler(word, candidate), candidate))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((likeness, candidate)) if likeness > 0.8 => format!("did you mean \"{candidate}\"?"),
        Some(_) => format!("use one of {}", known.join(", ")),
        None => "remove it".to_owned(),
    }
}

/// The first key in which two configurations of one type differ, with dots, and both values as JSON.
pub fn first_difference<T: Serialize>(theirs: &T, ours: &T) -> Option<(String, String, String)> {
    let value = |config| serde_json::to_value(config).expect("plain data with string keys");
    difference_below("", &value(theirs), &value(ours))
}

fn difference_below(
    key: &str,
    theirs: &serde_json::Value,
    ours: &serde_json::Value,
) -> Option<(String, String, String)> {
    if let (Some(a), Some(b)) = (theirs.as_object(), ours.as_object()) {
        let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
        return names.into_iter().find_map(|name| {
            let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
            let of = |table: &serde_json::Map<String, serde_json::Value>| {
                table.get(name).cloned().unwrap_or_default()
            };
            difference_below(&key, &of(a), &of(b))
        });
    }
    (theirs != ours).then(|| (key.to_owned(), theirs.to_string(), ours.to_string()))
}

fn suggest(word: &str, serde_message: &str) -> String {
    let expected = serde_message.split_once(", expected ").map_or("", |(_, expected)| expected);
    did_you_mean(word, expected.split('`').skip(1).step_by(2))
}

fn quoted_after<'a>(message: &'a str, prefix: &str) -> Option<&'a str> {
    message.strip_prefix(prefix)?.split('`').nth(1)
}

fn split_expected(message: &str) -> Option<(&str, &str)> {
    message.split_once(", expected ")
}

/// Serde's names of types in words that do not need Rust.
fn plain_type(expected: &str) -> String {
    match expected {
        "f64" | "f32" => "a number".to_owned(),
        "a string" => "a text in quotes".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a sequence" => "a list in [ ]".to_owned(),
        other if other.starts_with(['u', 'i']) && other[1..].parse::<u8>().is_ok() => {
            "a whole number".to_owned()
        }
        other => {
            other.strip_prefix("struct ").map_or_else(|| other.to_owned(), |name| format!("a table ({name})"))
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Ship {
        speed_kn: f64,
        #[serde(default)]
        motion: Motion,
    }

    #[derive(Debug, Default, Deserialize, PartialEq)]
    #[serde(rename_all = "snake_case")]
    enum Motion {
        #[default]
        Linear,
        Stochastic,
    }

    fn error(text: &str) -> String {
        Source::new("ship.toml", text).parse::<Ship>().expect_err("faulty text").to_string()
    }

    #[test]
    fn an_unknown_key_is_met_with_the_nearest_known_one() {
        let text = error("# own ship\nspeed = 12\n");
        assert_eq!(text, "ship.toml:2: unknown key \"speed\": did you mean \"speed_kn\"?");
    }

    #[test]
    fn a_value_of_the_wrong_type_names_its_key() {
        let text = error("speed_kn = \"fast\"\n");
        assert!(text.starts_with("ship.toml:1: key \"speed_kn\":"), "{text}");
        assert!(text.ends_with("write a number"), "{text}");
    }

    #[test]
    fn a_missing_key_is_named() {
        assert!(error("motion = \"linear\"\n").contains("\"speed_kn\" is missing: add `speed_kn = ...`"));
    }

    #[test]
    fn an_unknown_variant_is_met_with_the_nearest_known_one() {
        let text = error("speed_kn = 1.0\nmotion = \"stochastik\"\n");
        assert_eq!(
            text,
            "ship.toml:2: key \"motion\": unknown value \"stochastik\": did you mean \"stochastic\"?"
        );
    }

    #[test]
    fn broken_syntax_names_its_line() {
        assert!(error("speed_kn = 1.0\n\nmotion = = \n").starts_with("ship.toml:3:"));
    }

    #[test]
    fn a_missing_file_is_named() {
        let text = load::<Ship>(Path::new("no/such/file.toml")).expect_err("no file").to_string();
        assert!(text.starts_with("no/such/file.toml: cannot be read"), "{text}");
    }

    #[test]
    fn good_text_is_read() {
        let ship: Ship = Source::new("ship.toml", "speed_kn = 3.5").parse().expect("good text");
        assert_eq!((ship.speed_kn, ship.motion), (3.5, Motion::Linear));
    }
}
