//! JSON that knows where each value stands, so that whatever is wrong can be named with its line.
//!
//! A value is kept as its text, which is read one level at a time; what nobody asks for is checked for
//! syntax and otherwise left alone.

use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;

use serde::de::{Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;

use crate::config::{ConfigError, Source};

/// A document that is being read.
#[derive(Clone, Copy)]
pub(super) struct Document<'t> {
    file: &'t Path,
    text: &'t str,
}

/// A value of the document.
#[derive(Clone)]
pub(super) struct Node<'t> {
    document: Document<'t>,
    /// Path as a person writes it: `targetShips[1].initial.sog`, counted from 1.
    path: String,
    /// Its text, a part of the document's.
    raw: &'t str,
}

/// The entries of an object, and which of them were asked for.
pub(super) struct Object<'t> {
    node: Node<'t>,
    entries: Vec<(String, Node<'t>)>,
    known: BTreeSet<&'static str>,
}

/// The entries of an object in order, keys that stand twice included.
struct Entries<'t>(Vec<(String, &'t RawValue)>);

impl<'de> serde::Deserialize<'de> for Entries<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EntriesVisitor;
        impl<'de> Visitor<'de> for EntriesVisitor {
            type Value = Entries<'de>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(EntriesVisitor)
    }
}

impl<'t> Document<'t> {
    /// Checks the syntax of the whole text and returns its value.
    pub fn parse(file: &'t Path, text: &'t str) -> Result<Node<'t>, ConfigError> {
        // Windows programs begin files with a byte order mark.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let raw: &RawValue = serde_json::from_str(text).map_err(|error| ConfigError {
            file: file.to_owned(),
            line: Some(error.line().max(1)),
            key: None,
            message: format!("is not JSON ({error})"),
            remedy: "correct the JSON here".to_owned(),
        })?;
        Ok(Node { document: Self { file, text }, path: String::new(), raw: raw.get() })
    }
}

impl<'t> Node<'t> {
    /// An error about this value.
    pub fn error(&self, message: impl Into<String>, remedy: impl Into<String>) -> ConfigError {
        let offset = self.raw.as_ptr() as usize - self.document.text.as_ptr() as usize;
        let line = Source::new(self.document.file, self.document.text).line_of(offset);
        ConfigError {
            file: self.document.file.to_owned(),
            line: Some(line),
            key: (!self.path.is_empty()).then(|| self.path.clone()),
            message: message.into(),
            remedy: remedy.into(),
        }
    }

    /// Where it stands in the document.
    pub fn path(&self) -> &str {
        &self.path
    }

    fn is_null(&self) -> bool {
        self.raw == "null"
    }

    fn child(&self, name: &str, raw: &'t RawValue) -> Self {
        let path = match (self.path.as_str(), name.starts_with('[')) {
            ("", _) => name.to_owned(),
            (path, true) => format!("{path}{name}"),
            (path, false) => format!("{path}.{name}"),
        };
        Self { document: self.document, path, raw: raw.get() }
    }

    /// What kind of value it is, for errors.
    fn kind(&self) -> &'static str {
        match self.raw.as_bytes().first() {
            Some(b'{') => "an object",
            Some(b'[') => "a list",
            Some(b'"') => "a text",
            Some(b't' | b'f') => "true or false",
            Some(b'n') => "null",
            _ => "a number",
        }
    }

    fn wrong_kind(&self, wanted: &str, example: &str) -> ConfigError {
        self.error(format!("is {}, not {wanted}", self.kind()), format!("write {example}"))
    }

    /// The entries of an object.
    pub fn object(&self) -> Result<Object<'t>, ConfigError> {
        let Ok(Entries(entries)) = serde_json::from_str(self.raw) else {
            return Err(self.wrong_kind("an object", "{ ... }"));
        };
        let mut seen = BTreeSet::new();
        let mut nodes = Vec::with_capacity(entries.len());
        for (key, raw) in entries {
            let node = self.child(&key, raw);
            if !seen.insert(key.clone()) {
                return Err(node.error("stands twice in its object", "remove one of the two"));
            }
            nodes.push((key, node));
        }
        Ok(Object { node: self.clone(), entries: nodes, known: BTreeSet::new() })
    }

    /// The items of a list.
    pub fn list(&self) -> Result<Vec<Self>, ConfigError> {
        let items: Vec<&RawValue> =
            serde_json::from_str(self.raw).map_err(|_| self.wrong_kind("a list", "[ ... ]"))?;
        let item = |(index, raw): (usize, &'t RawValue)| self.child(&format!("[{}]", index + 1), raw);
        Ok(items.into_iter().enumerate().map(item).collect())
    }

    /// A number within bounds.
    pub fn number(&self, least: f64, most: f64) -> Result<f64, ConfigError> {
        let number: f64 =
            serde_json::from_str(self.raw).map_err(|_| self.wrong_kind("a number", "a number"))?;
        if (least..=most).contains(&number) {
            return Ok(number);
        }
        Err(self.error(
            format!("{number} is not possible here"),
            format!("write a number from {least} to {most}"),
        ))
    }

    /// A text.
    pub fn text(&self) -> Result<String, ConfigError> {
        serde_json::from_str(self.raw).map_err(|_| self.wrong_kind("a text", "it in quotes"))
    }

    /// Whether it is a number.
    pub fn is_number(&self) -> bool {
        self.kind() == "a number"
    }
}

impl<'t> Object<'t> {
    /// The value of the first of some keys that mean the same, which are known from now on. Null is as
    /// good as nothing: programs write it for whatever they do not know.
    pub fn get(&mut self, names: &[&'static str]) -> Option<Node<'t>> {
        self.known.extend(names);
        names.iter().find_map(|name| {
            let (_, node) = self.entries.iter().find(|(key, _)| key == name)?;
            (!node.is_null()).then(|| node.clone())
        })
    }

    /// As [`Self::get`], for what has to be there.
    pub fn require(&mut self, names: &[&'static str]) -> Result<Node<'t>, ConfigError> {
        self.get(names).ok_or_else(|| self.missing(names[0]))
    }

    /// That a key is missing.
    pub fn missing(&self, name: &str) -> ConfigError {
        let place = if self.node.path.is_empty() { "the file" } else { &self.node.path };
        self.node.error(format!("\"{name}\" is missing in {place}"), format!("add \"{name}\""))
    }

    /// The object itself.
    pub fn node(&self) -> &Node<'t> {
        &self.node
    }

    /// The keys that nobody asked for and that say something.
    pub fn unread(&self) -> impl Iterator<Item = &str> {
        self.entries
            .iter()
            .filter(|(key, node)| !node.is_null() && !self.known.contains(key.as_str()))
            .map(|(key, _)| key.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Node<'_>, ConfigError> {
        Document::parse(Path::new("t.json"), text)
    }

    #[test]
    fn values_are_named_with_path_and_line() {
        let node = parse("{\n \"a\": [1,\n  {\"b\": \"x\", \"c\": null}]}").unwrap();
        let mut root = node.object().unwrap();
        let items = root.get(&["a"]).unwrap().list().unwrap();
        assert_eq!(items[0].number(0.0, 2.0).unwrap(), 1.0);
        let mut inner = items[1].object().unwrap();
        let b = inner.get(&["b"]).unwrap();
        assert_eq!(b.text().unwrap(), "x");
        let error = b.number(0.0, 1.0).unwrap_err().to_string();
        assert_eq!(error, "t.json:3: key \"a[2].b\": is a text, not a number: write a number");
        assert!(inner.get(&["c"]).is_none(), "null says nothing");
        let error = inner.require(&["d"]).err().unwrap().to_string();
        assert_eq!(error, "t.json:3: key \"a[2]\": \"d\" is missing in a[2]: add \"d\"");
        let error = items[0].number(2.0, 3.0).unwrap_err().to_string();
        assert_eq!(error, "t.json:2: key \"a[1]\": 1 is not possible here: write a number from 2 to 3");
    }

    #[test]
    fn broken_and_doubled_json_is_refused() {
        let error = parse("{\n\"a\": }").err().unwrap().to_string();
        assert!(error.starts_with("t.json:2: is not JSON ("), "{error}");
        let doubled = parse("{\"a\": 1,\n\"a\": 2}").unwrap().object().err().unwrap().to_string();
        assert_eq!(doubled, "t.json:2: key \"a\": stands twice in its object: remove one of the two");
        assert!(parse("\u{feff}[]").unwrap().list().unwrap().is_empty());
        let deep = "[".repeat(100_000);
        assert!(parse(&deep).is_err());
    }

    #[test]
    fn what_nobody_asked_for_is_known() {
        let node = parse("{\"a\": 1, \"b\": null, \"c\": {}}").unwrap();
        let mut object = node.object().unwrap();
        object.get(&["a", "alias"]);
        assert_eq!(object.unread().collect::<Vec<_>>(), ["c"]);
    }
}
