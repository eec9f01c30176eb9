//! The part of the sea, the time and the vessels that an import keeps.

use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::read::time::TimeForm;
use crate::config::{ConfigError, Source};
use crate::geo::{Geodetic, LocalPlane, wrap_longitude_deg};

/// An area with its time window and filters, as its TOML file states them.
///
/// ```toml
/// name = "New York Lower Bay"
///
/// [box]
/// south_deg = 40.38
/// north_deg = 40.65
/// west_deg = -74.10
/// east_deg = -73.64
///
/// [time]                       # may be left out, like all that follows
/// from = "2020-12-01T00:00:00Z"
///
/// [filter]
/// ship_types = ["cargo", "tanker"]
/// ```
///
/// In place of `[box]`, `polygon_deg = [[latitude, longitude], ...]` gives the corners of a polygon. A box
/// whose west lies east of its east reaches across the antimeridian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Area {
    /// What people call it.
    pub name: String,
    /// The box, or the box around the polygon.
    #[serde(rename = "box")]
    pub bounds: GeoBox,
    /// Corners of the polygon, latitude and longitude in degrees; empty for a box.
    pub polygon_deg: Vec<[f64; 2]>,
    /// Messages outside this window are left out.
    pub time: TimeWindow,
    /// Vessels that are left out.
    pub filter: Filter,
}

/// A box between two parallels and two meridians.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeoBox {
    /// Southern edge, degrees north.
    pub south_deg: f64,
    /// Northern edge, degrees north.
    pub north_deg: f64,
    /// Western edge, degrees east.
    pub west_deg: f64,
    /// Eastern edge, degrees east.
    pub east_deg: f64,
}

/// A window of time; an end that is missing is open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TimeWindow {
    /// The first millisecond inside, since 1970-01-01 00:00:00 UTC.
    pub from_unix_ms: Option<i64>,
    /// The first millisecond after it.
    pub until_unix_ms: Option<i64>,
}

/// Which vessels an import keeps; what is left out does not filter.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Filter {
    /// Only these.
    pub mmsi: Vec<u32>,
    /// All but these.
    pub exclude_mmsi: Vec<u32>,
    /// Only these ship types: words such as `cargo`, AIS codes such as `70`, or ranges such as `70-79`.
    pub ship_types: Vec<String>,
    /// Only vessels of at least this length.
    pub min_length_m: Option<f64>,
    /// Only vessels of at most this length.
    pub max_length_m: Option<f64>,
    /// Only trajectories whose mean speed is at least this.
    pub min_mean_speed_kn: Option<f64>,
    /// Only trajectories whose mean speed is at most this.
    pub max_mean_speed_kn: Option<f64>,
}

/// The file's text before it is checked.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AreaFile {
    name: String,
    #[serde(rename = "box")]
    bounds: Option<Spanned<GeoBox>>,
    polygon_deg: Option<Spanned<Vec<[f64; 2]>>>,
    #[serde(default)]
    time: TimeFile,
    filter: Option<Spanned<Filter>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TimeFile {
    from: Option<Spanned<String>>,
    until: Option<Spanned<String>>,
}

impl Area {
    /// A box without time window or filters.
    pub fn of_box(name: &str, bounds: GeoBox) -> Self {
        Self {
            name: name.to_owned(),
            bounds,
            polygon_deg: Vec::new(),
            time: TimeWindow::default(),
            filter: Filter::default(),
        }
    }

    /// Reads an area file.
    ///
    /// # Errors
    /// With file, line, key and remedy where it is missing, has unknown keys, or its box, polygon
    /// or window cannot be.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::parse(&Source::read(path)?)
    }

    /// As [`Self::load`], from text in memory.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(source: &Source) -> Result<Self, ConfigError> {
        let file: AreaFile = source.parse()?;
        let (bounds, polygon_deg) = match (file.bounds, file.polygon_deg) {
            (Some(bounds), None) => {
                let span = bounds.span();
                let checked = bounds
                    .get_ref()
                    .checked(&|key, message, remedy| source.error_at(span.clone(), key, message, remedy))?;
                (checked, Vec::new())
            }
            (None, Some(polygon)) => {
                let bounds = check_polygon(source, &polygon)?;
                (bounds, polygon.into_inner())
            }
            (Some(_), Some(polygon)) => {
                let remedy = "keep one of the two";
                return Err(source.error_at(polygon.span(), "polygon_deg", "stands beside [box]", remedy));
            }
            (None, None) => {
                let remedy = "add a table [box] with south_deg, north_deg, west_deg and east_deg";
                return Err(source.error_at(0..0, "box", "is missing, and so is polygon_deg", remedy));
            }
        };
        let time = file.time.checked(source)?;
        if let Some(filter) = &file.filter {
            check_filter(source, filter)?;
        }
        let filter = file.filter.map(Spanned::into_inner).unwrap_or_default();
        Ok(Self { name: file.name, bounds, polygon_deg, time, filter })
    }

    /// Whether a point lies in the area.
    #[inline]
    pub fn contains(&self, point: Geodetic) -> bool {
        self.bounds.contains(point) && (self.polygon_deg.is_empty() || self.in_polygon(point))
    }

    /// The local plane of the area: it touches the ellipsoid in the middle of the box.
    pub fn plane(&self) -> LocalPlane {
        LocalPlane::at(self.bounds.centre())
    }

    /// Counts the polygon's edges that a ray to the east crosses; longitudes are taken relative to
    /// the point, so that the antimeridian is no seam.
    fn in_polygon(&self, point: Geodetic) -> bool {
        let corners = &self.polygon_deg;
        let relative = |corner: &[f64; 2]| (corner[0], wrap_longitude_deg(corner[1] - point.longitude_deg));
        let mut inside = false;
        for (index, corner) in corners.iter().enumerate() {
            let (from_lat, from_lon) = relative(corner);
            let (to_lat, to_lon) = relative(&corners[(index + 1) % corners.len()]);
            if (from_lat > point.latitude_deg) != (to_lat > point.latitude_deg) {
                let fraction = (point.latitude_deg - from_lat) / (to_lat - from_lat);
                inside ^= from_lon + fraction * (to_lon - from_lon) > 0.0;
            }
        }
        inside
    }
}

impl GeoBox {
    /// Whether a point lies in the box, edges included.
    #[inline]
    pub fn contains(&self, point: Geodetic) -> bool {
        (self.south_deg..=self.north_deg).contains(&point.latitude_deg)
            && self.contains_longitude(point.longitude_deg)
    }

    /// Whether a longitude lies in the box.
    #[inline]
    pub fn contains_longitude(&self, longitude_deg: f64) -> bool {
        if self.west_deg <= self.east_deg {
            (self.west_deg..=self.east_deg).contains(&longitude_deg)
        } else {
            longitude_deg >= self.west_deg || longitude_deg <= self.east_deg
        }
    }

    /// The middle of the box.
    pub fn centre(&self) -> Geodetic {
        Geodetic {
            latitude_deg: f64::midpoint(self.south_deg, self.north_deg),
            longitude_deg: wrap_longitude_deg(self.west_deg + self.width_deg() / 2.0),
        }
    }

    /// How far it reaches from west to east, in degrees.
    pub fn width_deg(&self) -> f64 {
        (self.east_deg - self.west_deg).rem_euclid(360.0)
    }

    fn checked(&self, fail: &dyn Fn(&str, &str, &str) -> ConfigError) -> Result<Self, ConfigError> {
        for (key, value, limit) in [
            ("south_deg", self.south_deg, 90.0),
            ("north_deg", self.north_deg, 90.0),
            ("west_deg", self.west_deg, 180.0),
            ("east_deg", self.east_deg, 180.0),
        ] {
            if !value.is_finite() || value.abs() > limit {
                let message = format!("{value} is not on the earth");
                return Err(fail(key, &message, &format!("give degrees between -{limit} and {limit}")));
            }
        }
        if self.south_deg >= self.north_deg {
            return Err(fail("south_deg", "is not south of north_deg", "exchange the two"));
        }
        if self.width_deg() == 0.0 {
            return Err(fail("west_deg", "is equal to east_deg", "give the box a width"));
        }
        if self.width_deg() > 180.0 {
            let remedy = "exchange west_deg and east_deg";
            return Err(fail("west_deg", "makes the box reach around more than half the earth", remedy));
        }
        Ok(*self)
    }
}

impl TimeWindow {
    /// Whether a time lies in the window.
    #[inline]
    pub fn contains(&self, unix_ms: i64) -> bool {
        self.from_unix_ms.is_none_or(|from| unix_ms >= from)
            && self.until_unix_ms.is_none_or(|until| unix_ms < until)
    }
}

impl TimeFile {
    fn checked(self, source: &Source) -> Result<TimeWindow, ConfigError> {
        let read = |key: &str, text: Option<Spanned<String>>| -> Result<Option<i64>, ConfigError> {
            let Some(text) = text else { return Ok(None) };
            let time = TimeForm::Iso.parse(text.get_ref().as_bytes()).ok_or_else(|| {
                let message = format!("\"{}\" is no time", text.get_ref());
                source.error_at(text.span(), key, message, "write it as \"2020-12-01T00:00:00Z\"")
            })?;
            Ok(Some(time))
        };
        let until_span = self.until.as_ref().map_or(0..0, Spanned::span);
        let window =
            TimeWindow { from_unix_ms: read("from", self.from)?, until_unix_ms: read("until", self.until)? };
        match (window.from_unix_ms, window.until_unix_ms) {
            (Some(from), Some(until)) if until <= from => {
                Err(source.error_at(until_span, "until", "is not after `from`", "exchange the two"))
            }
            _ => Ok(window),
        }
    }
}

fn check_polygon(source: &Source, polygon: &Spanned<Vec<[f64; 2]>>) -> Result<GeoBox, ConfigError> {
    let fail =
        |message: String, remedy: &str| source.error_at(polygon.span(), "polygon_deg", message, remedy);
    let corners = polygon.get_ref();
    if corners.len() < 3 {
        return Err(fail(format!("has {} corners", corners.len()), "give three corners at least"));
    }
    for [latitude_deg, longitude_deg] in corners.iter().copied() {
        if (Geodetic { latitude_deg, longitude_deg }).checked().is_none() {
            let message = format!("[{latitude_deg}, {longitude_deg}] is not on the earth");
            return Err(fail(message, "give [latitude, longitude] in degrees"));
        }
    }
    // Longitudes relative to the first corner, so that the box may reach across the antimeridian.
    let first_deg = corners[0][1];
    let (mut west, mut east) = (0.0_f64, 0.0_f64);
    let (mut south, mut north) = (f64::INFINITY, f64::NEG_INFINITY);
    for corner in corners {
        let relative = wrap_longitude_deg(corner[1] - first_deg);
        (west, east) = (west.min(relative), east.max(relative));
        (south, north) = (south.min(corner[0]), north.max(corner[0]));
    }
    let bounds = GeoBox {
        south_deg: south,
        north_deg: north,
        west_deg: wrap_longitude_deg(first_deg + west),
        east_deg: wrap_longitude_deg(first_deg + east),
    };
    bounds.checked(&|_, message, remedy| fail(message.to_owned(), remedy))
}

fn check_filter(source: &Source, filter: &Spanned<Filter>) -> Result<(), ConfigError> {
    let Filter { min_length_m, max_length_m, min_mean_speed_kn, max_mean_speed_kn, ship_types, .. } =
        filter.get_ref();
    for (key, least, most) in [
        ("max_length_m", min_length_m, max_length_m),
        ("max_mean_speed_kn", min_mean_speed_kn, max_mean_speed_kn),
    ] {
        if let (Some(least), Some(most)) = (least, most)
            && least > most
        {
            let message = format!("{most} is below the least value {least}");
            return Err(source.error_at(filter.span(), key, message, "exchange the two"));
        }
    }
    for ship_type in ship_types {
        if super::ship_type::Wanted::parse(ship_type).is_none() {
            let message = format!("\"{ship_type}\" is no ship type");
            let remedy = "use a word such as \"cargo\", a code such as \"70\" or a range such as \"70-79\"";
            return Err(source.error_at(filter.span(), "ship_types", message, remedy));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const BOX: &str = "[box]\nsouth_deg = 40.0\nnorth_deg = 41.0\nwest_deg = -74.5\neast_deg = -73.5\n";

    fn parse(rest: &str) -> Result<Area, ConfigError> {
        Area::parse(&Source::new("a.toml", format!("name = \"a\"\n{rest}")))
    }

    fn at(latitude_deg: f64, longitude_deg: f64) -> Geodetic {
        Geodetic { latitude_deg, longitude_deg }
    }

    #[test]
    fn impossible_areas_are_refused_with_line_and_remedy() {
        for (text, expected) in [
            (BOX.replace("41.0", "39.0"), "a.toml:2: key \"south_deg\": is not south of north_deg: exchange"),
            (BOX.replace("-74.5", "-190.0"), "key \"west_deg\": -190 is not on the earth"),
            (BOX.replace("-74.5", "-73.0"), "exchange west_deg and east_deg"),
            (
                BOX.replace("south_deg", "south"),
                "a.toml:3: unknown key \"south\": did you mean \"south_deg\"?",
            ),
            (String::new(), "key \"box\": is missing"),
            ("polygon_deg = [[1.0, 2.0], [2.0, 2.0]]".into(), "give three corners at least"),
            ("polygon_deg = [[1.0, 2.0], [95.0, 2.0], [2.0, 1.0]]".into(), "[95, 2] is not on the earth"),
            (
                format!("{BOX}[time]\nfrom = \"yesterday\"\n"),
                "a.toml:8: key \"from\": \"yesterday\" is no time",
            ),
            (
                format!("{BOX}[time]\nfrom = \"2020-12-02T00:00:00Z\"\nuntil = \"2020-12-01T00:00:00Z\""),
                "a.toml:9: key \"until\": is not after `from`",
            ),
            (format!("{BOX}[filter]\nmin_length_m = 100.0\nmax_length_m = 50.0\n"), "below the least value"),
            (format!("{BOX}[filter]\nship_types = [\"spaceship\"]\n"), "no ship type"),
        ] {
            let error = parse(&text).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn a_polygon_keeps_what_its_edges_enclose() {
        let area = parse("polygon_deg = [[0.0, 0.0], [0.0, 2.0], [2.0, 0.0]]").unwrap();
        assert!(area.contains(at(0.5, 0.5)));
        assert!(!area.contains(at(1.5, 1.5)));
        assert!(!area.contains(at(-0.5, 0.5)));
    }

    #[test]
    fn boxes_and_polygons_reach_across_the_antimeridian() {
        let by_box =
            parse("[box]\nsouth_deg = -18.0\nnorth_deg = -17.0\nwest_deg = 179.0\neast_deg = -179.0")
                .unwrap();
        let by_polygon =
            parse("polygon_deg = [[-18.0, 179.0], [-17.0, 179.0], [-17.0, -179.0], [-18.0, -179.0]]")
                .unwrap();
        for area in [by_box, by_polygon] {
            assert!(area.contains(at(-17.5, 179.5)) && area.contains(at(-17.5, -179.5)));
            assert!(!area.contains(at(-17.5, 178.5)) && !area.contains(at(-17.5, 0.0)));
            assert!((area.bounds.width_deg() - 2.0).abs() < 1e-9);
            assert!((area.plane().origin.longitude_deg.abs() - 180.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_window_holds_its_beginning_but_not_its_end() {
        let area =
            parse(&format!("{BOX}[time]\nfrom = \"2020-12-01T00:00:00Z\"\nuntil = \"2020-12-02T00:00:00Z\""))
                .unwrap();
        let start = 1_606_780_800_000;
        assert!(area.time.contains(start) && !area.time.contains(start - 1));
        assert!(!area.time.contains(start + 86_400_000));
    }

    proptest! {
        #[test]
        fn moving_an_area_around_the_earth_changes_nothing(
            latitude in -1.5..1.5_f64, longitude in -1.5..1.5_f64, around in -180.0..180.0_f64,
        ) {
            let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (0.0, 0.0), (1.0, -1.0)];
            let moved = |by: f64| {
                let list: Vec<String> =
                    corners.iter().map(|(lat, lon)| format!("[{lat:?}, {:?}]", wrap_longitude_deg(lon + by))).collect();
                parse(&format!("polygon_deg = [{}]", list.join(","))).unwrap()
            };
            // On an edge rounding decides.
            prop_assume!((latitude - longitude.abs()).abs() > 1e-6);
            let here = moved(0.0).contains(at(latitude, longitude));
            let there = moved(around).contains(at(latitude, wrap_longitude_deg(longitude + around)));
            prop_assert_eq!(here, there);
        }
    }
}
