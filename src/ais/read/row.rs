//! One line of a file: a message, or the reason why not.

use std::collections::{HashMap, HashSet};

use csv_core::{ReadRecordResult, Reader, ReaderBuilder, Terminator};
use memchr::{memchr, memchr_iter};

use super::number::{parse_decimal, parse_whole};
use crate::ais::area::Area;
use crate::ais::config::ImportConfig;
use crate::ais::format::Layout;
use crate::ais::message::{Message, Station};
use crate::ais::report::{ClearedFields, MessageDrop};
use crate::ais::ship_type;
use crate::geo::{Geodetic, MPS_PER_KNOT};
use crate::track::VesselParticulars;

/// Reads the rows of one layout, keeping what lies in the area.
///
/// A row ends with its line: a quoted column may hold delimiters and doubled quotes, but no line
/// break. AIS text has none, so a stray quote costs one row and not the rest of the file, and a
/// file can be cut at any line break and its parts be read side by side.
pub struct RowReader<'a> {
    layout: &'a Layout,
    area: &'a Area,
    wanted_mmsi: HashSet<u32>,
    unwanted_mmsi: HashSet<u32>,
    placeholders: HashSet<u32>,
    quoted: Reader,
    unquoted: Vec<u8>,
    ends: Vec<usize>,
    /// Optional fields cleared so far.
    pub cleared: ClearedFields,
    /// What is known of the vessels so far: of every particular the first value that says anything.
    pub vessels: HashMap<u32, VesselParticulars>,
}

/// The columns of a row: found as they are asked for in a plain line, all at once in a line with
/// quotes.
struct Columns<'l> {
    text: &'l [u8],
    delimiter: u8,
    /// Bytes between the end of one column and the beginning of the next.
    gap: usize,
    ends: &'l mut Vec<usize>,
}

impl<'l> Columns<'l> {
    #[inline]
    fn get(&mut self, column: usize) -> &'l [u8] {
        while self.ends.len() <= column {
            let start = self.ends.last().map_or(0, |end| end + self.gap);
            let length = memchr(self.delimiter, &self.text[start..]).unwrap_or(self.text.len() - start);
            self.ends.push(start + length);
        }
        let start = if column == 0 { 0 } else { self.ends[column - 1] + self.gap };
        &self.text[start..self.ends[column]]
    }
}

impl<'a> RowReader<'a> {
    /// A reader of rows laid out as `layout` says.
    pub fn new(layout: &'a Layout, area: &'a Area, config: &ImportConfig) -> Self {
        let set = |list: &[u32]| list.iter().copied().collect::<HashSet<u32>>();
        Self {
            layout,
            area,
            wanted_mmsi: set(&area.filter.mmsi),
            unwanted_mmsi: set(&area.filter.exclude_mmsi),
            placeholders: set(&config.placeholder_mmsi),
            quoted: ReaderBuilder::new()
                .delimiter(layout.delimiter)
                .terminator(Terminator::Any(b'\n'))
                .build(),
            unquoted: Vec::new(),
            ends: Vec::with_capacity(layout.columns + 1),
            cleared: ClearedFields::default(),
            vessels: HashMap::new(),
        }
    }

    /// Reads a line without its line break.
    ///
    /// # Errors
    /// The reason why it is no message to keep.
    #[inline]
    pub fn read(&mut self, line: &[u8]) -> Result<Message, MessageDrop> {
        if memchr(b'"', line).is_some() {
            return self.read_quoted(line);
        }
        if memchr_iter(self.layout.delimiter, line).count() + 1 != self.layout.columns {
            return Err(MessageDrop::WrongColumnCount);
        }
        let mut ends = std::mem::take(&mut self.ends);
        ends.clear();
        let columns = Columns { text: line, delimiter: self.layout.delimiter, gap: 1, ends: &mut ends };
        let message = self.decide(columns);
        self.ends = ends;
        message
    }

    /// As [`Self::read`], for any line whether it holds quotes or not.
    fn read_quoted(&mut self, line: &[u8]) -> Result<Message, MessageDrop> {
        let mut unquoted = std::mem::take(&mut self.unquoted);
        let mut ends = std::mem::take(&mut self.ends);
        unquoted.resize(line.len() + 2, 0);
        ends.clear();
        ends.resize(self.layout.columns + 1, 0);

        self.quoted.reset();
        let (inside, _, written, ended) = self.quoted.read_record(line, &mut unquoted, &mut ends);
        let outcome = if inside == ReadRecordResult::OutputEndsFull {
            Err(MessageDrop::WrongColumnCount)
        } else {
            // The line break closes the row, unless a quote is still open.
            let (at_end, _, _, more) =
                self.quoted.read_record(b"\n", &mut unquoted[written..], &mut ends[ended..]);
            match at_end {
                ReadRecordResult::Record if ended + more == self.layout.columns => Ok(()),
                ReadRecordResult::Record | ReadRecordResult::OutputEndsFull => {
                    Err(MessageDrop::WrongColumnCount)
                }
                _ => Err(MessageDrop::UnclosedQuote),
            }
        };
        let message = outcome.and_then(|()| {
            let columns =
                Columns { text: &unquoted, delimiter: self.layout.delimiter, gap: 0, ends: &mut ends };
            self.decide(columns)
        });
        (self.unquoted, self.ends) = (unquoted, ends);
        message
    }

    #[inline]
    fn decide(&mut self, mut columns: Columns<'_>) -> Result<Message, MessageDrop> {
        let position = self.position(&mut columns)?;
        self.vessel_message(position, &mut columns)
    }

    /// The position, if it is in the area. Most rows end here, many at the latitude alone.
    #[inline]
    fn position(&self, columns: &mut Columns<'_>) -> Result<Geodetic, MessageDrop> {
        let bounds = &self.area.bounds;
        let latitude_deg =
            parse_decimal(columns.get(self.layout.latitude_deg)).ok_or(MessageDrop::UnreadablePosition)?;
        let in_rows = (bounds.south_deg..=bounds.north_deg).contains(&latitude_deg);
        if !in_rows && latitude_deg.abs() <= 90.0 && !bounds.contains_longitude(latitude_deg) {
            return Err(MessageDrop::OutsideArea);
        }
        let longitude_deg =
            parse_decimal(columns.get(self.layout.longitude_deg)).ok_or(MessageDrop::UnreadablePosition)?;
        if latitude_deg == 91.0 || longitude_deg.abs() == 181.0 {
            return Err(MessageDrop::NoPosition);
        }
        let point = Geodetic { latitude_deg, longitude_deg }.checked();
        if let Some(point) = point.filter(|&point| self.area.contains(point)) {
            return Ok(point);
        }
        let swapped = Geodetic { latitude_deg: longitude_deg, longitude_deg: latitude_deg }.checked();
        Err(match point {
            _ if swapped.is_some_and(|point| self.area.contains(point)) => MessageDrop::SwappedPosition,
            None => MessageDrop::ImpossiblePosition,
            Some(_) => MessageDrop::OutsideArea,
        })
    }

    fn vessel_message(
        &mut self,
        position: Geodetic,
        columns: &mut Columns<'_>,
    ) -> Result<Message, MessageDrop> {
        let layout = self.layout;
        let unix_ms = layout.time_form.parse(columns.get(layout.time)).ok_or(MessageDrop::UnreadableTime)?;
        if !self.area.time.contains(unix_ms) {
            return Err(MessageDrop::OutsideTime);
        }
        let mmsi = parse_whole(columns.get(layout.mmsi)).ok_or(MessageDrop::UnreadableMmsi)?;
        self.check_station(mmsi, layout.station.map(|column| columns.get(column)))?;
        self.note_particulars(mmsi, columns);
        Ok(Message {
            mmsi,
            unix_ms,
            position,
            sog_mps: self.speed(columns),
            cog_deg: self.course(columns),
            heading_deg: self.heading(columns),
        })
    }

    fn check_station(&self, mmsi: u32, station: Option<&[u8]>) -> Result<(), MessageDrop> {
        let is_vessel_word =
            station.is_none_or(|word| word.is_empty() || word.to_ascii_lowercase().starts_with(b"class"));
        match Station::of(mmsi) {
            _ if !is_vessel_word => Err(MessageDrop::NotAVessel),
            _ if self.placeholders.contains(&mmsi) => Err(MessageDrop::ImpossibleMmsi),
            Station::Other => Err(MessageDrop::NotAVessel),
            Station::Impossible => Err(MessageDrop::ImpossibleMmsi),
            Station::Vessel if !self.wanted_mmsi.is_empty() && !self.wanted_mmsi.contains(&mmsi) => {
                Err(MessageDrop::FilteredMmsi)
            }
            Station::Vessel if self.unwanted_mmsi.contains(&mmsi) => Err(MessageDrop::FilteredMmsi),
            Station::Vessel => Ok(()),
        }
    }

    fn note_particulars(&mut self, mmsi: u32, columns: &mut Columns<'_>) {
        let layout = self.layout;
        let known = self.vessels.entry(mmsi).or_default();
        if let (None, Some(column)) = (&known.ship_type, layout.ship_type) {
            known.ship_type = ship_type::normalised(&String::from_utf8_lossy(columns.get(column)));
        }
        for (value, column) in [(&mut known.length_m, layout.length_m), (&mut known.beam_m, layout.beam_m)] {
            if let (None, Some(column)) = (&value, column) {
                *value = parse_decimal(columns.get(column)).filter(|&metres| metres > 0.0);
            }
        }
    }

    fn speed(&mut self, columns: &mut Columns<'_>) -> f32 {
        optional(self.layout.sog_kn, columns, &mut self.cleared.sog, |knots| {
            // 102.2 stands for any speed above it, 102.3 for none known.
            (0.0..=102.2).contains(&knots).then_some(knots * MPS_PER_KNOT)
        })
    }

    fn course(&mut self, columns: &mut Columns<'_>) -> f32 {
        optional(self.layout.cog_deg, columns, &mut self.cleared.cog, |degrees| {
            // Tenths of degrees in twelve signed bits: what overflowed lacks 4096 tenths.
            let degrees = if degrees < 0.0 { degrees + 409.6 } else { degrees };
            (0.0..360.0).contains(&degrees).then_some(degrees)
        })
    }

    fn heading(&mut self, columns: &mut Columns<'_>) -> f32 {
        optional(self.layout.heading_deg, columns, &mut self.cleared.heading, |degrees| {
            (0.0..360.0).contains(&degrees).then_some(degrees)
        })
    }
}

/// A field that a message can do without: not a number where it is missing, a sentinel or
/// unreadable, and counted in the latter two cases.
fn optional(
    column: Option<usize>,
    columns: &mut Columns<'_>,
    cleared: &mut u64,
    valid: impl FnOnce(f64) -> Option<f64>,
) -> f32 {
    let Some(text) = column.map(|column| columns.get(column)).filter(|text| !text.is_empty()) else {
        return f32::NAN;
    };
    parse_decimal(text).and_then(valid).map_or_else(
        || {
            *cleared += 1;
            f32::NAN
        },
        |value| value as f32,
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::ais::area::GeoBox;

    const HEADER: &[u8] =
        b"# Timestamp,Type of mobile,MMSI,Latitude,Longitude,SOG,COG,Heading,Name,Ship type,Length";

    fn area() -> Area {
        Area::of_box("test", GeoBox { south_deg: 54.0, north_deg: 58.0, west_deg: 7.0, east_deg: 13.0 })
    }

    fn with_reader<T>(work: impl FnOnce(&mut RowReader<'_>) -> T) -> T {
        let (layout, area, config) =
            (Layout::recognise(HEADER, None).unwrap(), area(), ImportConfig::default());
        work(&mut RowReader::new(&layout, &area, &config))
    }

    fn read(line: &str) -> Result<Message, MessageDrop> {
        with_reader(|reader| reader.read(line.as_bytes()))
    }

    #[test]
    fn a_good_row_is_a_message() {
        let message =
            read("01/11/2022 09:05:36,Class A,219900023,55.41161,7.985228,11.4,91.4,95,ANNA,Cargo,100")
                .unwrap();
        assert_eq!((message.mmsi, message.unix_ms), (219_900_023, 1_667_293_536_000));
        assert_eq!(message.position, Geodetic { latitude_deg: 55.41161, longitude_deg: 7.985228 });
        assert!(
            (message.sog_mps - 5.8647).abs() < 1e-3 && message.cog_deg == 91.4 && message.heading_deg == 95.0
        );
    }

    #[test]
    fn every_fault_has_its_reason() {
        use MessageDrop as D;
        let row = |time: &str, station: &str, mmsi: &str, latitude: &str, longitude: &str| {
            read(&format!("{time},{station},{mmsi},{latitude},{longitude},,,,,,")).unwrap_err()
        };
        const T: &str = "01/11/2022 09:05:36";
        assert_eq!(row(T, "Class A", "219900023", "91.0", "181.0"), D::NoPosition);
        assert_eq!(row(T, "Class A", "219900023", "55.0", "181"), D::NoPosition);
        assert_eq!(row(T, "Class A", "219900023", "8.0", "55.5"), D::SwappedPosition);
        assert_eq!(row(T, "Class A", "219900023", "95.0", "8.0"), D::ImpossiblePosition);
        assert_eq!(row(T, "Class A", "219900023", "55.0", "200.0"), D::ImpossiblePosition);
        assert_eq!(row(T, "Class A", "219900023", "55.0", "20.0"), D::OutsideArea);
        assert_eq!(row(T, "Class A", "219900023", "40.0", "8.0"), D::OutsideArea);
        for position in ["", "NaN", "inf", "-inf", "1e999", "fifty"] {
            assert_eq!(row(T, "Class A", "219900023", position, "8.0"), D::UnreadablePosition, "{position}");
            assert_eq!(row(T, "Class A", "219900023", "55.0", position), D::UnreadablePosition, "{position}");
        }
        assert_eq!(row("31/02/2022 09:05:36", "Class A", "219900023", "55.0", "8.0"), D::UnreadableTime);
        assert_eq!(row(T, "Class A", "ship", "55.0", "8.0"), D::UnreadableMmsi);
        assert_eq!(row(T, "Class A", "123456789", "55.0", "8.0"), D::ImpossibleMmsi);
        assert_eq!(row(T, "Base Station", "219900023", "55.0", "8.0"), D::NotAVessel);
        assert_eq!(row(T, "", "2190047", "55.0", "8.0"), D::NotAVessel);
        assert_eq!(read("01/11/2022 09:05:36,Class A,219900023,55.4").unwrap_err(), D::WrongColumnCount);
        assert_eq!(
            read("01/11/2022 09:05:36,Class A,219900023,55.4,8.0,,,,\"AN,Cargo,100").unwrap_err(),
            D::UnclosedQuote
        );
    }

    #[test]
    fn a_quoted_name_may_hold_delimiters_and_quotes() {
        with_reader(|reader| {
            let line = "01/11/2022 09:05:36,Class A,219900023,55.4,8.0,,,,\"A, \"\"B\"\"\",Cargo,100";
            reader.read(line.as_bytes()).unwrap();
            assert_eq!(reader.vessels[&219_900_023].ship_type.as_deref(), Some("Cargo"));
            assert_eq!(reader.vessels[&219_900_023].length_m, Some(100.0));
        });
    }

    #[test]
    fn sentinels_clear_a_field_and_signed_courses_come_back() {
        with_reader(|reader| {
            let row = |fields: &str| format!("01/11/2022 09:05:36,Class A,219900023,55.4,8.0,{fields},,,");
            let cleared = reader.read(row("102.3,360.0,511").as_bytes()).unwrap();
            assert!(cleared.sog_mps.is_nan() && cleared.cog_deg.is_nan() && cleared.heading_deg.is_nan());
            let missing = reader.read(row(",,").as_bytes()).unwrap();
            assert!(missing.sog_mps.is_nan());
            assert_eq!(reader.cleared, ClearedFields { sog: 1, cog: 1, heading: 1 });
            let signed = reader.read(row("0.0,-60.6,0").as_bytes()).unwrap();
            assert!((signed.cog_deg - 349.0).abs() < 1e-3);
        });
    }

    fn same(a: &Result<Message, MessageDrop>, b: &Result<Message, MessageDrop>) -> bool {
        format!("{a:?}") == format!("{b:?}")
    }

    fn field() -> impl Strategy<Value = String> {
        prop_oneof![
            Just("01/11/2022 09:05:36".to_owned()),
            Just("219900023".to_owned()),
            (540..600_i32).prop_map(|tenths| format!("{}", f64::from(tenths) / 10.0)),
            (60..140_i32).prop_map(|tenths| format!("{}", f64::from(tenths) / 10.0)),
            "[ -~&&[^\",]]{0,8}",
        ]
    }

    proptest! {
        #[test]
        fn plain_rows_read_the_same_on_the_fast_and_the_quoted_path(fields in proptest::collection::vec(field(), 10..13)) {
            let mut sensible = fields.clone();
            sensible[0] = "01/11/2022 09:05:36".to_owned();
            sensible[2] = "219900023".to_owned();
            for row in [fields, sensible] {
                let plain = row.join(",");
                let quoted = row.iter().map(|field| format!("\"{field}\"")).collect::<Vec<_>>().join(",");
                let fast = read(&plain);
                prop_assert!(same(&fast, &with_reader(|reader| reader.read_quoted(plain.as_bytes()))));
                prop_assert!(same(&fast, &read(&quoted)));
            }
        }

        #[test]
        fn any_bytes_are_a_message_or_a_reason(line in proptest::collection::vec(any::<u8>(), 0..200)) {
            let line: Vec<u8> = line.into_iter().filter(|&byte| byte != b'\n').collect();
            with_reader(|reader| {
                let _ = reader.read(&line);
                let _ = reader.read_quoted(&line);
            });
        }
    }
}
