//! Any other CSV layout, described by a TOML file that names its columns.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Layout, plain};
use crate::ais::read::time::TimeForm;
use crate::config::{ConfigError, Source, did_you_mean};

/// Names the columns of a CSV layout.
///
/// ```toml
/// time = "ts"
/// time_form = "unix_s"      # iso, day_first, month_first, unix_s or unix_ms
/// mmsi = "id"
/// latitude_deg = "y"
/// longitude_deg = "x"
/// sog_kn = "speed"          # this and what follows may be left out
/// delimiter = ";"
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnMapping {
    /// The character between two columns.
    #[serde(default = "comma")]
    pub delimiter: char,
    /// Column of the time.
    pub time: String,
    /// How the time is written.
    #[serde(default)]
    pub time_form: TimeForm,
    /// Column of the MMSI.
    pub mmsi: String,
    /// Column of the latitude in degrees.
    pub latitude_deg: String,
    /// Column of the longitude in degrees.
    pub longitude_deg: String,
    /// Column of the speed over ground in knots.
    pub sog_kn: Option<String>,
    /// Column of the course over ground in degrees.
    pub cog_deg: Option<String>,
    /// Column of the heading in degrees.
    pub heading_deg: Option<String>,
    /// Column of the kind of station in words.
    pub station: Option<String>,
    /// Column of the ship type.
    pub ship_type: Option<String>,
    /// Column of the length in metres.
    pub length_m: Option<String>,
    /// Column of the beam in metres.
    pub beam_m: Option<String>,
}

fn comma() -> char {
    ','
}

impl ColumnMapping {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// Where it is missing, not TOML, or its delimiter is not one plain character.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::parse(&Source::read(path)?)
    }

    /// As [`Self::load`], from text in memory.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(source: &Source) -> Result<Self, ConfigError> {
        let mapping: Self = source.parse()?;
        if !mapping.delimiter.is_ascii() || matches!(mapping.delimiter, '"' | '\n' | '\r') {
            let at = source.text.find("delimiter").unwrap_or(0);
            let message = format!("{:?} cannot separate columns", mapping.delimiter);
            return Err(source.error_at(at..at, "delimiter", message, "use \",\", \";\", \"|\" or \"\\t\""));
        }
        Ok(mapping)
    }

    pub(super) fn delimiter_byte(&self) -> u8 {
        // Checked to be ASCII on reading; a mapping built in code falls back to the comma.
        u8::try_from(self.delimiter).unwrap_or(b',')
    }

    pub(super) fn layout(&self, columns: &[String]) -> Result<Layout, (String, String)> {
        let need = |name: &String| {
            columns.iter().position(|column| *column == plain(name)).ok_or_else(|| {
                let known = columns.iter().map(String::as_str);
                (
                    format!("has no column `{name}`, which the mapping names"),
                    did_you_mean(&plain(name), known),
                )
            })
        };
        let may = |name: &Option<String>| name.as_ref().map(need).transpose();
        Ok(Layout {
            name: "column mapping".to_owned(),
            delimiter: self.delimiter_byte(),
            columns: columns.len(),
            time: need(&self.time)?,
            time_form: self.time_form,
            mmsi: need(&self.mmsi)?,
            latitude_deg: need(&self.latitude_deg)?,
            longitude_deg: need(&self.longitude_deg)?,
            sog_kn: may(&self.sog_kn)?,
            cog_deg: may(&self.cog_deg)?,
            heading_deg: may(&self.heading_deg)?,
            station: may(&self.station)?,
            ship_type: may(&self.ship_type)?,
            length_m: may(&self.length_m)?,
            beam_m: may(&self.beam_m)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAPPING: &str = "delimiter = \";\"\ntime = \"ts\"\ntime_form = \"unix_s\"\nmmsi = \"id\"\nlatitude_deg = \"y\"\nlongitude_deg = \"x\"\n";

    #[test]
    fn columns_are_found_by_name() {
        let mapping = ColumnMapping::parse(&Source::new("m.toml", MAPPING)).unwrap();
        let layout = Layout::recognise(b"id;x;y;ts", Some(&mapping)).unwrap();
        assert_eq!((layout.mmsi, layout.longitude_deg, layout.latitude_deg, layout.time), (0, 1, 2, 3));
        assert_eq!((layout.delimiter, layout.time_form), (b';', TimeForm::UnixSeconds));
    }

    #[test]
    fn a_column_that_is_not_there_is_named() {
        let mapping = ColumnMapping::parse(&Source::new("m.toml", MAPPING)).unwrap();
        let (problem, _) = Layout::recognise(b"id;x;y;time", Some(&mapping)).unwrap_err();
        assert!(problem.contains("`ts`"), "{problem}");
    }

    #[test]
    fn a_delimiter_that_is_part_of_csv_is_refused() {
        let text = MAPPING.replace("\";\"", "'\"'");
        let error = ColumnMapping::parse(&Source::new("m.toml", text)).unwrap_err();
        assert!(error.to_string().starts_with("m.toml:1: key \"delimiter\""), "{error}");
    }
}
