//! Tracks on a map: an SVG with graticule in degrees, scale bar, colour by speed and arrows.

use std::fmt::Write as _;

use super::xml_escaped;
use crate::ais::{Area, iso_utc};
use crate::angle::Nautical;
use crate::geo::{Geodetic, LocalPlane, M_PER_NMI, MPS_PER_KNOT, Position, wrap_longitude_deg};
use crate::track::Track;

/// Largest width and height of the map itself, in pixels.
const MAP_PX: (f64, f64) = (1040.0, 820.0);
/// Space around it: left, top, right, bottom.
const MARGIN_PX: (f64, f64, f64, f64) = (70.0, 74.0, 128.0, 74.0);
/// Speeds from which each colour holds, in knots. From slow to fast the colours also darken.
const COLOURS: [(f64, &str); 6] = [
    (0.0, "#9aa7b5"),
    (2.0, "#56a3d9"),
    (5.0, "#1a9d84"),
    (10.0, "#e0a100"),
    (15.0, "#dd4f2a"),
    (20.0, "#8a1656"),
];
/// Least way along a track between two arrows.
const ARROW_EVERY_PX: f64 = 110.0;
/// About how many arrows a map carries; on a crowded one they stand farther apart.
const ARROWS_AT_MOST: f64 = 220.0;
/// Detail below this is left out, so that the file stays small.
const DETAIL_PX: f64 = 0.35;
/// Distances between lines of the graticule, in minutes of arc.
const GRATICULE_MIN: [f64; 11] = [1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0];

/// Draws the tracks of an area as an SVG.
pub fn draw(tracks: &[Track], plane: &LocalPlane, area: &Area) -> String {
    let frame = Frame::around(area, plane);
    let mut svg = String::new();
    frame.open(&mut svg, area, tracks);
    let _ = writeln!(svg, r#"<g clip-path="url(#map)">"#);
    graticule(&mut svg, &frame, area, plane);
    outline(&mut svg, &frame, area, plane);
    let way_px: f64 = tracks.iter().map(Track::path_length_m).sum::<f64>() * frame.px_per_m;
    let arrow_every_px = ARROW_EVERY_PX.max(way_px / ARROWS_AT_MOST);
    let mut until_arrow_px = arrow_every_px / 2.0;
    let paths: Vec<Drawn> =
        tracks.iter().map(|track| Drawn::of(track, &frame, arrow_every_px, &mut until_arrow_px)).collect();
    // Slow traffic below, so that the passages stay in sight.
    for colour in 0..COLOURS.len() {
        lines_of_colour(&mut svg, &paths, colour);
    }
    for path in &paths {
        arrows(&mut svg, path);
    }
    svg.push_str("</g>\n");
    frame.labels(&mut svg, area, plane);
    scale_bar(&mut svg, &frame);
    legend(&mut svg, &frame);
    svg.push_str("</svg>\n");
    svg
}

/// Where the plane lies on the page.
struct Frame {
    /// North-west corner of the map on the plane.
    corner: Position,
    px_per_m: f64,
    width_px: f64,
    height_px: f64,
}

impl Frame {
    fn around(area: &Area, plane: &LocalPlane) -> Self {
        let edge = edge_of(area);
        let corners: Vec<Position> = edge.iter().map(|&point| plane.project(point)).collect();
        let span = |values: &dyn Fn(&Position) -> f64| {
            corners.iter().map(values).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            })
        };
        let (south_m, north_m) = span(&|position| position.north_m);
        let (west_m, east_m) = span(&|position| position.east_m);
        let (width_m, height_m) = (east_m - west_m, north_m - south_m);
        let px_per_m = (MAP_PX.0 / width_m).min(MAP_PX.1 / height_m);
        Self {
            corner: Position { north_m, east_m: west_m },
            px_per_m,
            width_px: width_m * px_per_m,
            height_px: height_m * px_per_m,
        }
    }

    fn px(&self, position: Position) -> (f64, f64) {
        let from_corner = position - self.corner;
        (MARGIN_PX.0 + from_corner.east_m * self.px_per_m, MARGIN_PX.1 - from_corner.north_m * self.px_per_m)
    }

    fn right_px(&self) -> f64 {
        MARGIN_PX.0 + self.width_px
    }

    fn bottom_px(&self) -> f64 {
        MARGIN_PX.1 + self.height_px
    }

    fn open(&self, svg: &mut String, area: &Area, tracks: &[Track]) {
        let (width, height) = (self.right_px() + MARGIN_PX.2, self.bottom_px() + MARGIN_PX.3);
        let (left, top) = (MARGIN_PX.0, MARGIN_PX.1);
        let mut vessels: Vec<u32> = tracks.iter().map(|track| track.mmsi).collect();
        vessels.sort_unstable();
        vessels.dedup();
        let first = tracks.iter().map(|track| track.start_unix_s).min();
        let last = tracks.iter().map(|track| track.unix_s(track.positions.len() - 1) as i64).max();
        let when = match (first, last) {
            (Some(first), Some(last)) => format!(", {} to {}", minutes(first), minutes(last)),
            _ => String::new(),
        };
        let _ = write!(
            svg,
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0} {height:.0}" width="{width:.0}" height="{height:.0}" font-family="system-ui, 'Segoe UI', Helvetica, Arial, sans-serif" font-size="13" fill="#24323f">
<title>{name}: recorded tracks</title>
<rect width="100%" height="100%" fill="#ffffff"/>
<defs><clipPath id="map"><rect x="{left}" y="{top}" width="{map_width:.1}" height="{map_height:.1}"/></clipPath></defs>
<text x="{left}" y="34" font-size="22" font-weight="600">{name}</text>
<text x="{left}" y="56" fill="#5b6b79">{tracks} of {vessels}{when}</text>
<rect x="{left}" y="{top}" width="{map_width:.1}" height="{map_height:.1}" fill="#f3f8fc"/>
"##,
            name = xml_escaped(&area.name),
            map_width = self.width_px,
            map_height = self.height_px,
            tracks = counted(tracks.len(), "track"),
            vessels = counted(vessels.len(), "vessel"),
        );
    }

    /// Frame and degrees along its left and lower edge.
    fn labels(&self, svg: &mut String, area: &Area, plane: &LocalPlane) {
        let (left, top, bottom) = (MARGIN_PX.0, MARGIN_PX.1, self.bottom_px());
        let _ = writeln!(
            svg,
            r##"<rect x="{left}" y="{top}" width="{:.1}" height="{:.1}" fill="none" stroke="#24323f"/>"##,
            self.width_px, self.height_px
        );
        let west_deg = area.bounds.west_deg;
        for latitude_deg in parallels(area) {
            let (_, y) = self.px(plane.project(Geodetic { latitude_deg, longitude_deg: west_deg }));
            let text = degrees_text(latitude_deg, 'N', 'S');
            let _ = writeln!(
                svg,
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{text}</text>"#,
                left - 7.0,
                y + 4.5
            );
        }
        for longitude_deg in meridians(area) {
            let south = Geodetic { latitude_deg: area.bounds.south_deg, longitude_deg };
            let (x, _) = self.px(plane.project(south));
            let text = degrees_text(longitude_deg, 'E', 'W');
            let _ = writeln!(
                svg,
                r#"<text x="{x:.1}" y="{:.1}" text-anchor="middle">{text}</text>"#,
                bottom + 19.0
            );
        }
    }
}

/// Points along the edge of the area's box, which is bent on the plane.
fn edge_of(area: &Area) -> Vec<Geodetic> {
    const STEPS: u32 = 24;
    let bounds = &area.bounds;
    let mut edge = Vec::new();
    for (from, to) in [
        ((0.0, 0.0), (0.0, 1.0)),
        ((0.0, 1.0), (1.0, 1.0)),
        ((1.0, 1.0), (1.0, 0.0)),
        ((1.0, 0.0), (0.0, 0.0)),
    ] {
        for step in 0..STEPS {
            let fraction = f64::from(step) / f64::from(STEPS);
            let (north, east): (f64, f64) =
                (from.0 + fraction * (to.0 - from.0), from.1 + fraction * (to.1 - from.1));
            edge.push(Geodetic {
                latitude_deg: bounds.south_deg + north * (bounds.north_deg - bounds.south_deg),
                longitude_deg: wrap_longitude_deg(bounds.west_deg + east * bounds.width_deg()),
            });
        }
    }
    edge
}

/// The border of the area: its polygon, or its box.
fn outline(svg: &mut String, frame: &Frame, area: &Area, plane: &LocalPlane) {
    if area.polygon_deg.is_empty() {
        return;
    }
    let corners = area.polygon_deg.iter();
    let corners = corners.map(|&[latitude_deg, longitude_deg]| Geodetic { latitude_deg, longitude_deg });
    let points: Vec<String> = corners
        .map(|corner| frame.px(plane.project(corner)))
        .map(|(x, y)| format!("{x:.1},{y:.1}"))
        .collect();
    let _ = writeln!(
        svg,
        r##"<polygon points="{}" fill="none" stroke="#24323f" stroke-dasharray="6 4"/>"##,
        points.join(" ")
    );
}

fn graticule(svg: &mut String, frame: &Frame, area: &Area, plane: &LocalPlane) {
    const STEPS: u32 = 24;
    let bounds = &area.bounds;
    let mut line = |point: &dyn Fn(f64) -> Geodetic| {
        let points =
            (0..=STEPS).map(|step| frame.px(plane.project(point(f64::from(step) / f64::from(STEPS)))));
        let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            svg,
            r##"<polyline points="{}" fill="none" stroke="#c9d7e2" stroke-width="1"/>"##,
            points.join(" ")
        );
    };
    for latitude_deg in parallels(area) {
        line(&|fraction| Geodetic {
            latitude_deg,
            longitude_deg: wrap_longitude_deg(bounds.west_deg + fraction * bounds.width_deg()),
        });
    }
    for longitude_deg in meridians(area) {
        line(&|fraction| Geodetic {
            latitude_deg: bounds.south_deg + fraction * (bounds.north_deg - bounds.south_deg),
            longitude_deg,
        });
    }
}

fn parallels(area: &Area) -> Vec<f64> {
    let bounds = &area.bounds;
    round_values(bounds.south_deg, bounds.north_deg - bounds.south_deg, 5.0)
}

fn meridians(area: &Area) -> Vec<f64> {
    let bounds = &area.bounds;
    round_values(bounds.west_deg, bounds.width_deg(), 7.0).into_iter().map(wrap_longitude_deg).collect()
}

/// Round values in minutes of arc over a stretch of degrees, at most so many of them.
fn round_values(from_deg: f64, width_deg: f64, at_most: f64) -> Vec<f64> {
    let fits = |step_min: &&f64| width_deg * 60.0 / **step_min <= at_most;
    let step_deg = GRATICULE_MIN.iter().find(fits).unwrap_or(&600.0) / 60.0;
    let first = (from_deg / step_deg).ceil();
    let count = ((from_deg + width_deg) / step_deg).floor() - first;
    (0..=count.max(0.0) as u32).map(|index| (first + f64::from(index)) * step_deg).collect()
}

/// `40°30′N`
fn degrees_text(value_deg: f64, positive: char, negative: char) -> String {
    let all_minutes = (value_deg.abs() * 60.0).round() as u32;
    let side = if value_deg < 0.0 { negative } else { positive };
    format!("{}°{:02}′{side}", all_minutes / 60, all_minutes % 60)
}

/// A track on the page, without detail too small to see.
struct Drawn {
    points: Vec<(f64, f64)>,
    /// Colour of the line that leads to each point but the first.
    colours: Vec<usize>,
    /// Position in pixels and course of the arrows.
    arrows: Vec<((f64, f64), Nautical, usize)>,
}

impl Drawn {
    /// The way to the next arrow runs on from track to track, so that short ones get their share.
    fn of(track: &Track, frame: &Frame, arrow_every_px: f64, until_arrow_px: &mut f64) -> Self {
        let mut drawn = Self { points: Vec::new(), colours: Vec::new(), arrows: Vec::new() };
        let last = track.positions.len() - 1;
        for (index, &position) in track.positions.iter().enumerate() {
            let here = frame.px(position);
            let Some(&before) = drawn.points.last() else {
                drawn.points.push(here);
                continue;
            };
            let step_px = (here.0 - before.0).hypot(here.1 - before.1);
            if step_px < DETAIL_PX * 4.0 && index < last {
                continue;
            }
            let velocity = track.velocity(index);
            let colour = colour_of(velocity.speed_mps());
            drawn.points.push(here);
            drawn.colours.push(colour);
            *until_arrow_px -= step_px;
            if *until_arrow_px <= 0.0 && velocity.speed_mps() > COLOURS[1].0 * MPS_PER_KNOT {
                drawn.arrows.push((here, velocity.course(), colour));
                *until_arrow_px = arrow_every_px;
            }
        }
        drawn
    }
}

fn colour_of(speed_mps: f64) -> usize {
    COLOURS.iter().rposition(|&(from_kn, _)| speed_mps / MPS_PER_KNOT >= from_kn).unwrap_or(0)
}

fn lines_of_colour(svg: &mut String, paths: &[Drawn], colour: usize) {
    let mut data = String::new();
    for path in paths {
        let mut pen_at = usize::MAX;
        for (leg, _) in path.colours.iter().enumerate().filter(|&(_, &has)| has == colour) {
            if pen_at != leg {
                let (x, y) = path.points[leg];
                let _ = write!(data, "M{x:.1} {y:.1}");
            }
            let (x, y) = path.points[leg + 1];
            let _ = write!(data, "L{x:.1} {y:.1}");
            pen_at = leg + 1;
        }
    }
    let stroke = COLOURS[colour].1;
    let _ = writeln!(
        svg,
        r#"<path d="{data}" fill="none" stroke="{stroke}" stroke-width="1.3" stroke-opacity="0.8" stroke-linejoin="round" stroke-linecap="round"/>"#
    );
}

fn arrows(svg: &mut String, path: &Drawn) {
    for ((x, y), course, colour) in &path.arrows {
        let fill = COLOURS[*colour].1;
        let _ = writeln!(
            svg,
            r##"<path d="M0 -6.5L3.8 4L0 2L-3.8 4Z" transform="translate({x:.1} {y:.1}) rotate({:.0})" fill="{fill}" stroke="#ffffff" stroke-width="0.7"/>"##,
            course.degrees()
        );
    }
}

/// A bar of a round number of nautical miles, halved, with its length in kilometres.
fn scale_bar(svg: &mut String, frame: &Frame) {
    let widest_nmi = 0.25 * frame.width_px / frame.px_per_m / M_PER_NMI;
    let round = |nmi: f64| {
        let power = 10_f64.powf(nmi.log10().floor());
        [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|&value| value <= nmi).unwrap_or(power)
    };
    let nmi = round(widest_nmi);
    let length_px = nmi * M_PER_NMI * frame.px_per_m;
    let (x, y) = (frame.right_px() - length_px, frame.bottom_px() + 52.0);
    let half = length_px / 2.0;
    let km = nmi * M_PER_NMI / 1000.0;
    let _ = writeln!(
        svg,
        r##"<g><rect x="{x:.1}" y="{y:.1}" width="{half:.1}" height="6" fill="#24323f"/>
<rect x="{:.1}" y="{y:.1}" width="{half:.1}" height="6" fill="#ffffff" stroke="#24323f"/>
<text x="{:.1}" y="{:.1}" text-anchor="end">{nmi} nmi ({km:.1} km)</text></g>"##,
        x + half,
        x - 10.0,
        y + 8.0,
    );
}

fn legend(svg: &mut String, frame: &Frame) {
    let (x, top) = (frame.right_px() + 22.0, MARGIN_PX.1);
    let _ = writeln!(svg, r#"<text x="{x:.1}" y="{:.1}" font-weight="600">speed (kn)</text>"#, top + 12.0);
    for (row, (from_kn, colour)) in COLOURS.iter().rev().enumerate() {
        let y = top + 26.0 + 24.0 * row as f64;
        let until = COLOURS.iter().map(|&(kn, _)| kn).find(|kn| kn > from_kn);
        let text = until.map_or_else(|| format!("over {from_kn}"), |until| format!("{from_kn} to {until}"));
        let _ = writeln!(
            svg,
            r#"<rect x="{x:.1}" y="{y:.1}" width="22" height="15" rx="2" fill="{colour}"/><text x="{:.1}" y="{:.1}">{text}</text>"#,
            x + 30.0,
            y + 12.0
        );
    }
}

fn counted(many: usize, what: &str) -> String {
    format!("{many} {what}{}", if many == 1 { "" } else { "s" })
}

fn minutes(unix_s: i64) -> String {
    iso_utc(unix_s)[..16].replace('T', " ") + " UTC"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ais::GeoBox;
    use crate::track::VesselParticulars;

    fn drawing() -> String {
        let bounds = GeoBox { south_deg: 40.38, north_deg: 40.64, west_deg: -74.08, east_deg: -73.64 };
        let area = Area::of_box("Bay <A & B>", bounds);
        let track = Track {
            mmsi: 219_000_001,
            start_unix_s: 1_606_780_800,
            dt_s: 5.0,
            positions: (0..600)
                .map(|k| Position { north_m: 0.0, east_m: 30.0 * f64::from(k) - 9000.0 })
                .collect(),
            particulars: VesselParticulars::default(),
        };
        draw(&[track], &area.plane(), &area)
    }

    #[test]
    fn a_map_says_where_when_and_how_fast() {
        let svg = drawing();
        for expected in [
            "Bay &lt;A &amp; B&gt;",
            "1 track of 1 vessel, 2020-12-01 00:00 UTC to 2020-12-01 00:49 UTC",
            "40°30′N",
            "74°00′W",
            "speed (kn)",
            "5 nmi (9.3 km)",
        ] {
            assert!(svg.contains(expected), "{expected}");
        }
    }

    #[test]
    fn arrows_point_along_the_course_in_the_colour_of_the_speed() {
        let svg = drawing();
        let arrows: Vec<&str> = svg.lines().filter(|line| line.contains("rotate(")).collect();
        assert!(arrows.len() > 2);
        // 30 m in 5 s are 11.7 knots.
        assert!(arrows.iter().all(|arrow| arrow.contains("rotate(90)") && arrow.contains("#e0a100")));
    }

    #[test]
    fn the_graticule_is_round_and_sparse() {
        assert_eq!(round_values(40.38, 0.26, 5.0).len(), 3);
        assert_eq!(degrees_text(-74.0, 'E', 'W'), "74°00′W");
        assert_eq!(degrees_text(40.5, 'N', 'S'), "40°30′N");
    }
}
