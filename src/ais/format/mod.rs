//! CSV layouts of AIS data: one file and one line of [`FORMATS`] each.
//!
//! A layout is told by the header, the first line of a file. Column names are compared without
//! regard to case, blanks and punctuation.

use super::read::time::TimeForm;

mod dma;
mod mapping;
mod marine_cadastre;

pub use mapping::ColumnMapping;

/// The known layouts, tried in this order.
const FORMATS: &[&Format] = &[&dma::FORMAT, &marine_cadastre::FORMAT];

/// A layout: the names under which its columns may appear.
#[derive(Debug)]
struct Format {
    name: &'static str,
    /// A column only this layout has.
    mark: &'static [&'static str],
    time: &'static [&'static str],
    time_form: TimeForm,
    mmsi: &'static [&'static str],
    latitude_deg: &'static [&'static str],
    longitude_deg: &'static [&'static str],
    sog_kn: &'static [&'static str],
    cog_deg: &'static [&'static str],
    heading_deg: &'static [&'static str],
    station: &'static [&'static str],
    ship_type: &'static [&'static str],
    length_m: &'static [&'static str],
    beam_m: &'static [&'static str],
}

/// Where a file keeps what, as places of columns counted from 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Name for reports.
    pub name: String,
    /// The byte between two columns.
    pub delimiter: u8,
    /// How many columns the header has.
    pub columns: usize,
    /// Time of the report, and the form it is written in.
    pub time: usize,
    /// How times are written.
    pub time_form: TimeForm,
    /// Maritime Mobile Service Identity.
    pub mmsi: usize,
    /// Latitude in degrees north.
    pub latitude_deg: usize,
    /// Longitude in degrees east.
    pub longitude_deg: usize,
    /// Speed over ground in knots.
    pub sog_kn: Option<usize>,
    /// Course over ground in degrees.
    pub cog_deg: Option<usize>,
    /// Heading in degrees.
    pub heading_deg: Option<usize>,
    /// Kind of station in words, such as `Class A` or `Base Station`.
    pub station: Option<usize>,
    /// Ship type, a word or an AIS code.
    pub ship_type: Option<usize>,
    /// Length over all in metres.
    pub length_m: Option<usize>,
    /// Greatest beam in metres.
    pub beam_m: Option<usize>,
}

impl Layout {
    /// Recognises a header line; a mapping takes precedence over the known layouts.
    ///
    /// # Errors
    /// What the line looks like instead, and what to do about it.
    pub fn recognise(header: &[u8], mapping: Option<&ColumnMapping>) -> Result<Self, (String, String)> {
        if let Some(mapping) = mapping {
            return mapping.layout(&columns_of(header, mapping.delimiter_byte()));
        }
        let columns = columns_of(header, b',');
        let format = FORMATS.iter().find(|format| find(&columns, format.mark).is_some());
        format.map_or_else(|| Err(diagnose(header)), |format| format.layout(&columns))
    }
}

impl Format {
    fn layout(&self, columns: &[String]) -> Result<Layout, (String, String)> {
        let need = |what: &str, names: &[&str]| {
            find(columns, names).ok_or_else(|| {
                let problem = format!("looks like {} but has no column for the {what}", self.name);
                let remedy = format!("name the column `{}`, or use a column mapping", names[0]);
                (problem, remedy)
            })
        };
        Ok(Layout {
            name: self.name.to_owned(),
            delimiter: b',',
            columns: columns.len(),
            time: need("time", self.time)?,
            time_form: self.time_form,
            mmsi: need("MMSI", self.mmsi)?,
            latitude_deg: need("latitude", self.latitude_deg)?,
            longitude_deg: need("longitude", self.longitude_deg)?,
            sog_kn: find(columns, self.sog_kn),
            cog_deg: find(columns, self.cog_deg),
            heading_deg: find(columns, self.heading_deg),
            station: find(columns, self.station),
            ship_type: find(columns, self.ship_type),
            length_m: find(columns, self.length_m),
            beam_m: find(columns, self.beam_m),
        })
    }
}

/// The header's columns, reduced to lower-case letters and digits.
fn columns_of(header: &[u8], delimiter: u8) -> Vec<String> {
    let header = header.strip_prefix(b"\xef\xbb\xbf").unwrap_or(header);
    header.split(|&byte| byte == delimiter).map(|column| plain(&String::from_utf8_lossy(column))).collect()
}

fn plain(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|letter| letter.to_ascii_lowercase()).collect()
}

fn find(columns: &[String], names: &[&str]) -> Option<usize> {
    names.iter().map(|name| plain(name)).find_map(|name| columns.iter().position(|column| *column == name))
}

/// What a first line is that is no known header.
fn diagnose(header: &[u8]) -> (String, String) {
    let mapping = "describe the layout with a column mapping (--mapping FILE.toml)";
    if header.starts_with(b"\xff\xfe") || header.starts_with(b"\xfe\xff") {
        return ("is UTF-16 text".into(), "save it as UTF-8".into());
    }
    if header.iter().any(|&byte| byte < b' ' && byte != b'\t') {
        return (
            "is not text but binary data".into(),
            "name a CSV file, plain or as .gz, .zst or .zip".into(),
        );
    }
    for (delimiter, name) in [(b';', "semicolons"), (b'\t', "tabs"), (b'|', "bars")] {
        let columns = columns_of(header, delimiter);
        if FORMATS.iter().any(|format| find(&columns, format.mark).is_some()) {
            let problem = format!("separates its columns with {name} instead of commas");
            return (
                problem,
                format!("convert it, or {mapping} and `delimiter = {:?}`", char::from(delimiter)),
            );
        }
    }
    if columns_of(header, b',').iter().any(|column| column.parse::<f64>().is_ok()) {
        return ("begins with data instead of a header".into(), "add the header line".into());
    }
    let excerpt: String = String::from_utf8_lossy(header).chars().take(60).collect();
    let known: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
    let problem = format!("`{excerpt}` is not the header of a known layout ({})", known.join(", "));
    (problem, mapping.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DMA: &[u8] = b"# Timestamp,Type of mobile,MMSI,Latitude,Longitude,Navigational status,ROT,SOG,COG,\
Heading,IMO,Callsign,Name,Ship type,Cargo type,Width,Length";

    #[test]
    fn the_danish_header_is_recognised() {
        let layout = Layout::recognise(DMA, None).unwrap();
        assert_eq!((layout.time, layout.mmsi, layout.latitude_deg, layout.longitude_deg), (0, 2, 3, 4));
        assert_eq!(
            (layout.sog_kn, layout.ship_type, layout.beam_m, layout.length_m),
            (Some(7), Some(13), Some(15), Some(16))
        );
        assert_eq!(layout.time_form, TimeForm::DayFirst);
    }

    #[test]
    fn both_headers_of_marine_cadastre_are_recognised() {
        let upper = Layout::recognise(b"MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading", None).unwrap();
        assert_eq!((upper.mmsi, upper.time, upper.latitude_deg, upper.longitude_deg), (0, 1, 2, 3));
        let lower =
            Layout::recognise(b"mmsi,base_date_time,longitude,latitude,sog,cog,heading,vessel_name", None)
                .unwrap();
        assert_eq!((lower.time, lower.longitude_deg, lower.latitude_deg, lower.sog_kn), (1, 2, 3, Some(4)));
    }

    #[test]
    fn other_first_lines_are_told_apart() {
        for (header, expected) in [
            (&b"MMSI;BaseDateTime;LAT;LON"[..], "semicolons"),
            (b"MMSI\tBaseDateTime\tLAT\tLON", "tabs"),
            (b"MMSI,BaseDateTime,LAT,SOG", "no column for the longitude"),
            (b"\x7fELF\x02\x01\x01\x00\x00", "binary"),
            (b"\xff\xfeM\x00M\x00", "UTF-16"),
            (b"367466930,2020-12-01T04:49:45,40.41692,-74.0315", "data instead of a header"),
            (b"name,age,city", "not the header of a known layout"),
        ] {
            let (problem, remedy) = Layout::recognise(header, None).unwrap_err();
            assert!(problem.contains(expected), "{problem}");
            assert!(!remedy.is_empty());
        }
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_the_header() {
        let header = [b"\xef\xbb\xbf", DMA].concat();
        assert!(Layout::recognise(&header, None).is_ok());
    }
}
