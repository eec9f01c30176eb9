//! Reading a TOML table key by key, so that whatever is wrong can be named: the key, what is the
//! matter with it and how to mend it.
//!
//! A [`Section`] remembers which keys it was asked for. A key nobody asked for is a fault, and the
//! keys that were asked for tell what the writer probably meant: `speed` where `speed_kn` is known.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::config::{Fault, join};
use crate::geo::{M_PER_NMI, MPS_PER_KNOT};

/// A unit a quantity may be written in: the suffix of the key, and its size in SI.
pub(super) struct Unit {
    suffix: &'static str,
    si: f64,
}

/// A quantity of a scenario file: the key without its unit, and the units that may be written.
pub(super) struct Quantity {
    stem: &'static str,
    units: &'static [Unit],
}

impl Quantity {
    /// A speed, `STEM_kn` or `STEM_mps`.
    pub const fn speed(stem: &'static str) -> Self {
        Self { stem, units: &[Unit { suffix: "kn", si: MPS_PER_KNOT }, Unit { suffix: "mps", si: 1.0 }] }
    }

    /// A length, `STEM_m` or `STEM_nmi`.
    pub const fn length(stem: &'static str) -> Self {
        Self { stem, units: &[Unit { suffix: "m", si: 1.0 }, Unit { suffix: "nmi", si: M_PER_NMI }] }
    }

    /// A time span, `STEM_s` or `STEM_min`.
    pub const fn time(stem: &'static str) -> Self {
        Self { stem, units: &[Unit { suffix: "s", si: 1.0 }, Unit { suffix: "min", si: 60.0 }] }
    }

    fn keys(&self) -> Vec<String> {
        self.units.iter().map(|unit| format!("{}_{}", self.stem, unit.suffix)).collect()
    }
}

/// Which numbers a key takes.
#[derive(Clone, Copy)]
pub(super) enum Takes {
    Any,
    Positive,
    NotNegative,
    Between(f64, f64),
}

impl Takes {
    fn allows(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::Positive => value > 0.0,
            Self::NotNegative => value >= 0.0,
            Self::Between(least, most) => (least..=most).contains(&value),
        }
    }

    fn remedy(self) -> String {
        match self {
            Self::Any => "write a number".to_owned(),
            Self::Positive => "write a number above 0".to_owned(),
            Self::NotNegative => "write 0 or a number above it".to_owned(),
            Self::Between(least, most) => format!("write a number from {least} to {most}"),
        }
    }
}

/// One table of the file.
pub(super) struct Section<'t> {
    path: String,
    table: &'t DeTable<'t>,
    known: Vec<String>,
}

impl<'t> Section<'t> {
    pub fn root(table: &'t DeTable<'t>) -> Self {
        Self { path: String::new(), table, known: Vec::new() }
    }

    /// The path of one of this section's keys.
    pub fn key(&self, key: &str) -> String {
        join(&self.path, key)
    }

    /// A fault of one of this section's keys.
    pub fn fault(&self, key: &str, message: impl Into<String>, remedy: impl Into<String>) -> Fault {
        Fault::new(self.key(key), message, remedy)
    }

    /// The value of a key, which is known from now on.
    pub fn value(&mut self, key: &str) -> Option<&'t DeValue<'t>> {
        if !self.known.iter().any(|known| known == key) {
            self.known.push(key.to_owned());
        }
        self.table.get(key).map(Spanned::get_ref)
    }

    /// Whether any of these keys is written; they are known from now on.
    pub fn has_any(&mut self, keys: &[&str]) -> bool {
        keys.iter().map(|key| self.value(key).is_some()).fold(false, |any, written| any | written)
    }

    /// Whether a quantity is written in any of its units; its keys are known from now on.
    pub fn has(&mut self, quantity: &Quantity) -> bool {
        self.has_any(&quantity.keys().iter().map(String::as_str).collect::<Vec<_>>())
    }

    pub fn number(&mut self, key: &str, takes: Takes) -> Result<Option<f64>, Fault> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let number = number_of(value).ok_or_else(|| {
            self.fault(key, format!("is {}, not a number", named(value)), unquoted(key, value))
        })?;
        if number.is_finite() && takes.allows(number) {
            Ok(Some(number))
        } else {
            Err(self.fault(key, format!("{number} is not possible here"), takes.remedy()))
        }
    }

    /// A quantity in SI, written with exactly one of its units, where it is written.
    pub fn quantity(&mut self, quantity: &Quantity, takes: Takes) -> Result<Option<f64>, Fault> {
        let mut found: Option<(String, f64)> = None;
        for (key, unit) in quantity.keys().into_iter().zip(quantity.units) {
            let Some(number) = self.number(&key, takes)? else { continue };
            if let Some((first, _)) = found {
                let message = format!("says the same as {first}");
                return Err(self.fault(&key, message, format!("write {first} or {key}, not both")));
            }
            found = Some((key, number * unit.si));
        }
        Ok(found.map(|(_, value)| value))
    }

    pub fn required_quantity(&mut self, quantity: &Quantity, takes: Takes) -> Result<f64, Fault> {
        match self.quantity(quantity, takes)? {
            Some(value) => Ok(value),
            None => Err(self.missing(&quantity.keys())),
        }
    }

    pub fn required_number(&mut self, key: &str, takes: Takes) -> Result<f64, Fault> {
        self.number(key, takes)?.ok_or_else(|| self.missing(&[key.to_owned()]))
    }

    pub fn integer(&mut self, key: &str) -> Result<Option<u64>, Fault> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let parsed = match value {
            DeValue::Integer(integer) => u64::from_str_radix(integer.as_str(), integer.radix()).ok(),
            _ => None,
        };
        parsed.map(Some).ok_or_else(|| {
            self.fault(key, "is not a whole number", "write 0, 1, 2 and so on, without quotes")
        })
    }

    pub fn text(&mut self, key: &str) -> Result<Option<String>, Fault> {
        let Some(value) = self.value(key) else { return Ok(None) };
        match value {
            DeValue::String(text) => Ok(Some(text.to_string())),
            other => Err(self.fault(
                key,
                format!("is {}, not a text", named(other)),
                format!("write it in quotes: {key} = \"...\""),
            )),
        }
    }

    /// A text that is one of a few words.
    pub fn choice<T: Copy>(&mut self, key: &str, choices: &[(&str, T)]) -> Result<Option<T>, Fault> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        choices.iter().find(|(word, _)| *word == text).map(|(_, choice)| Some(*choice)).ok_or_else(|| {
            let words = choices.iter().map(|(word, _)| format!("\"{word}\"")).collect::<Vec<_>>();
            self.fault(key, format!("\"{text}\" is not known here"), format!("write {}", either(&words)))
        })
    }

    /// One text or a list of texts.
    pub fn texts(&mut self, key: &str) -> Result<Option<Vec<String>>, Fault> {
        let Some(DeValue::Array(list)) = self.value(key) else {
            return Ok(self.text(key)?.map(|text| vec![text]));
        };
        list.iter()
            .map(|item| item.get_ref().as_str().map(str::to_owned))
            .collect::<Option<Vec<_>>>()
            .map(Some)
            .ok_or_else(|| {
                self.fault(
                    key,
                    "holds something that is not a text",
                    format!("write {key} = [\"...\", \"...\"]"),
                )
            })
    }

    /// A moment, as a TOML date-time or as a text; returned as written.
    pub fn moment(&mut self, key: &str) -> Result<Option<String>, Fault> {
        match self.value(key) {
            Some(DeValue::Datetime(moment)) => Ok(Some(moment.to_string())),
            _ => self.text(key),
        }
    }

    pub fn section(&mut self, key: &str) -> Result<Option<Section<'t>>, Fault> {
        match self.value(key) {
            None => Ok(None),
            Some(DeValue::Table(table)) => {
                Ok(Some(Section { path: self.key(key), table, known: Vec::new() }))
            }
            Some(other) => Err(self.fault(
                key,
                format!("is {}, not a table", named(other)),
                format!("write a table [{}]", self.key(key)),
            )),
        }
    }

    /// A list of tables; empty where it is not written.
    pub fn sections(&mut self, key: &str) -> Result<Vec<Section<'t>>, Fault> {
        let fault = |section: &Self| {
            section.fault(
                key,
                "is not a list of tables",
                format!("write [[{}]] above each", section.key(key)),
            )
        };
        let list = match self.value(key) {
            None => return Ok(Vec::new()),
            Some(DeValue::Array(list)) => list,
            Some(_) => return Err(fault(self)),
        };
        let path = |index: usize| format!("{}[{}]", self.key(key), index + 1);
        list.iter()
            .enumerate()
            .map(|(index, item)| match item.get_ref() {
                DeValue::Table(table) => Ok(Section { path: path(index), table, known: Vec::new() }),
                _ => Err(fault(self)),
            })
            .collect()
    }

    /// The fault that one of `keys` has to be written. A key that nobody knows and that looks like
    /// one of them is the likelier mistake, and is named instead.
    pub fn missing(&self, keys: &[String]) -> Fault {
        let slip = self.unknown().find(|unknown| keys.iter().any(|key| resembles(unknown, key)));
        match slip {
            Some(unknown) => self.unknown_fault(unknown),
            None => {
                let path = if self.path.is_empty() { "the scenario" } else { &self.path };
                let key = keys.first().map_or("", String::as_str);
                self.fault(key, format!("is missing in {path}"), format!("write {}", either(keys)))
            }
        }
    }

    /// To be called when everything was asked for: whatever is left is a fault.
    pub fn finish(self) -> Result<(), Fault> {
        match self.unknown().next() {
            Some(unknown) => Err(self.unknown_fault(unknown)),
            None => Ok(()),
        }
    }

    fn unknown(&self) -> impl Iterator<Item = &str> {
        self.table
            .keys()
            .map(|key| key.get_ref().as_ref())
            .filter(|key| !self.known.iter().any(|known| known == key))
    }

    fn unknown_fault(&self, unknown: &str) -> Fault {
        let similar =
            self.known.iter().filter(|known| resembles(unknown, known)).cloned().collect::<Vec<_>>();
        let remedy = if similar.is_empty() {
            format!("the keys known here are {}", self.known.join(", "))
        } else {
            format!("write {}", either(&similar))
        };
        self.fault(unknown, "is not a known key", remedy)
    }
}

/// `a`, `a or b`, `a, b or c`.
pub(super) fn either(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

fn number_of(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(integer) => {
            let digits = integer.as_str();
            i128::from_str_radix(digits, integer.radix())
                .map_or_else(|_| digits.parse().ok(), |n| Some(n as f64))
        }
        DeValue::Float(float) => float.as_str().parse().ok(),
        _ => None,
    }
}

fn named(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

fn unquoted(key: &str, value: &DeValue<'_>) -> String {
    match value.as_str().map(|text| text.trim().parse::<f64>()) {
        Some(Ok(number)) => format!("write {key} = {number}, without quotes"),
        _ => format!("write {key} = 12.5, for example"),
    }
}

/// Whether somebody who wrote `unknown` may have meant `known`: the same quantity with another unit
/// or with none, or two letters off.
fn resembles(unknown: &str, known: &str) -> bool {
    let stem = |key: &str| key.rsplit_once('_').map(|(stem, _)| stem.to_owned());
    let known_stem = stem(known);
    known_stem.as_deref() == Some(unknown)
        || (known_stem.is_some() && known_stem == stem(unknown))
        || strsim::levenshtein(unknown, known) <= 2.min(known.chars().count() / 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_resembles_its_quantity_in_another_unit() {
        assert!(resembles("speed", "speed_kn"));
        assert!(resembles("speed_kmh", "speed_kn"));
        assert!(resembles("corse_deg", "course_deg"));
        assert!(!resembles("north_m", "speed_kn"));
        assert!(!resembles("mmi", "dt"));
    }
}
