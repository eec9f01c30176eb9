//! A page with a small picture of every episode: one row per encounter, one column per policy. It needs
//! nothing else, neither network nor server.

use std::fmt::Write as _;
use std::path::Path;

use crate::atomic_file::{self, WriteError};
use crate::episode::Episode;
use crate::geo::Position;

use super::replay::text_in_html;

/// Sides of a picture, in pixels.
const SIDE_PX: f64 = 150.0;
/// Left free around the paths, in pixels.
const MARGIN_PX: f64 = 8.0;
/// Points closer together than this are one in a picture, in pixels.
const RESOLUTION_PX: f64 = 0.7;
/// Fewer metres than this are not enlarged to fill a picture.
const LEAST_EXTENT_M: f64 = 1000.0;

/// Height of a line of text in a figure, in pixels.
const LINE_PX: f64 = 18.0;
/// Width of the row headings in a figure, in pixels.
const HEADING_PX: f64 = 40.0;

const PAGE_STYLE: &str = include_str!("pictures.css");
const PICTURE_STYLE: &str = include_str!("picture.css");

/// The paths of one episode as SVG text.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture(String);

impl Picture {
    /// Draws an episode: own ship's path, those of the target ships, and where own ship came closest to one.
    #[must_use]
    pub fn of(episode: &Episode) -> Self {
        let positions = |vessel: usize| episode.steps.iter().map(move |step| step.vessels[vessel].position);
        let frame = Frame::around((0..episode.vessels.len()).flat_map(positions));
        let mut svg = format!(
            "<svg viewBox=\"0 0 {SIDE_PX} {SIDE_PX}\" role=\"img\" aria-label=\"{}\">",
            text_in_html(&format!("{} under {}", episode.scenario, episode.policy)).replace('"', "&quot;")
        );
        for vessel in (0..episode.vessels.len()).rev() {
            let class = if vessel == 0 { "own" } else { "target" };
            let _ = write!(svg, "<path class=\"{class}\" d=\"{}\"/>", frame.path(positions(vessel)));
            if let Some(start) = positions(vessel).next() {
                let (x, y) = frame.place(start);
                let _ = write!(svg, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\"/>");
            }
        }
        let nearest =
            episode.summaries().into_iter().min_by(|a, b| a.closest_centre_m.total_cmp(&b.closest_centre_m));
        if let Some(nearest) = nearest {
            let class = if episode.has_contact() { "contact" } else { "closest" };
            let step = nearest.closest_centre_time_s / episode.dt_s;
            for vessel in [0, nearest.vessel] {
                let (x, y) = frame.place(position_at(episode, vessel, step));
                let _ = write!(svg, "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\"/>");
            }
        }
        svg.push_str("</svg>");
        Self(svg)
    }

    /// The picture as SVG text, styled by the page it stands in.
    #[must_use]
    pub fn svg(&self) -> &str {
        &self.0
    }
}

/// Where a vessel is at a step and a fraction of the next.
fn position_at(episode: &Episode, vessel: usize, step: f64) -> Position {
    let last = episode.steps.len() - 1;
    let before = (step.max(0.0) as usize).min(last);
    let position = |step: usize| episode.steps[step].vessels[vessel].position;
    position(before).lerp(position((before + 1).min(last)), step - before as f64)
}

/// From metres north and east to pixels right and down, a metre as long on either axis.
struct Frame {
    centre: Position,
    px_per_m: f64,
}

impl Frame {
    fn around(positions: impl Iterator<Item = Position>) -> Self {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for position in positions.filter(|position| position.is_finite()) {
            for (axis, value) in [position.north_m, position.east_m].into_iter().enumerate() {
                least[axis] = least[axis].min(value);
                most[axis] = most[axis].max(value);
            }
        }
        let extent_m = (most[0] - least[0]).max(most[1] - least[1]).max(LEAST_EXTENT_M);
        let middle =
            |axis: usize| if most[axis].is_finite() { 0.5 * (least[axis] + most[axis]) } else { 0.0 };
        Self {
            centre: Position { north_m: middle(0), east_m: middle(1) },
            px_per_m: (SIDE_PX - 2.0 * MARGIN_PX) / extent_m,
        }
    }

    fn place(&self, position: Position) -> (f64, f64) {
        let from_centre = position - self.centre;
        let middle = 0.5 * SIDE_PX;
        (middle + self.px_per_m * from_centre.east_m, middle - self.px_per_m * from_centre.north_m)
    }

    /// Places apart by less than the resolution are one, and what lies between the ends of a straight stretch
    /// is left out.
    fn path(&self, positions: impl Iterator<Item = Position>) -> String {
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for place in positions.filter(|position| position.is_finite()).map(|position| self.place(position)) {
            if let [.., begin, middle] = kept[..]
                && (is_near(middle, place) || is_straight(begin, middle, place))
            {
                kept.pop();
            }
            kept.push(place);
        }
        let mut data = String::new();
        for (index, (x, y)) in kept.into_iter().enumerate() {
            let _ = write!(data, "{}{x:.1} {y:.1}", if index == 0 { "M" } else { "L" });
        }
        data
    }
}

fn is_near(a: (f64, f64), b: (f64, f64)) -> bool {
    (b.0 - a.0).hypot(b.1 - a.1) < RESOLUTION_PX
}

/// Whether the middle of three places lies on the straight line between the others, to a few hundredths of a
/// pixel.
fn is_straight(begin: (f64, f64), middle: (f64, f64), end: (f64, f64)) -> bool {
    let (way, part) = ((end.0 - begin.0, end.1 - begin.1), (middle.0 - begin.0, middle.1 - begin.1));
    (way.0 * part.1 - way.1 * part.0).abs() <= 0.03 * way.0.hypot(way.1)
}

/// Pictures in rows and columns, each with a line of text under it.
#[derive(Debug, Clone, PartialEq)]
pub struct PicturePage {
    /// Title of the page.
    pub title: String,
    /// What is shown, in a paragraph.
    pub note: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Heading and cells of each row.
    pub rows: Vec<(String, Vec<(Picture, String)>)>,
}

impl PicturePage {
    /// Writes the page whole.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        atomic_file::write(path, |out| out.write_all(self.page().as_bytes()))
    }

    /// Writes the same as one SVG figure; its row headings are cut at the first colon.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write_figure(&self, path: &Path) -> Result<(), WriteError> {
        atomic_file::write(path, |out| out.write_all(self.figure().as_bytes()))
    }

    fn figure(&self) -> String {
        let row_px = SIDE_PX + LINE_PX;
        let width = HEADING_PX + SIDE_PX * self.columns.len() as f64;
        let height = LINE_PX + row_px * self.rows.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"12\" text-anchor=\"middle\">\n\
             <style>\n{PICTURE_STYLE}</style>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
        );
        let text = |svg: &mut String, x: f64, y: f64, text: &str| {
            let _ = writeln!(svg, "<text x=\"{x}\" y=\"{y}\">{}</text>", text_in_html(text));
        };
        let left = |column: usize| HEADING_PX + SIDE_PX * column as f64;
        for (column, heading) in self.columns.iter().enumerate() {
            text(&mut svg, left(column) + 0.5 * SIDE_PX, 0.75 * LINE_PX, heading);
        }
        for (row, (heading, cells)) in self.rows.iter().enumerate() {
            let top = LINE_PX + row_px * row as f64;
            let short = heading.split(':').next().unwrap_or_default();
            text(&mut svg, 0.5 * HEADING_PX, top + 0.5 * SIDE_PX, short);
            for (column, (picture, below)) in cells.iter().enumerate() {
                let place = format!(
                    "<svg x=\"{}\" y=\"{top}\" width=\"{SIDE_PX}\" height=\"{SIDE_PX}\" ",
                    left(column)
                );
                svg.push_str(&picture.svg().replacen("<svg ", &place, 1));
                text(&mut svg, left(column) + 0.5 * SIDE_PX, top + SIDE_PX + 0.6 * LINE_PX, below);
            }
        }
        svg.push_str("</svg>\n");
        svg
    }

    fn page(&self) -> String {
        let title = text_in_html(&self.title);
        let mut page = format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n\
             <style>\n{PAGE_STYLE}{PICTURE_STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<p>{}</p>\n<div class=\"scroll\">\n\
             <table>\n<thead>\n<tr><th></th>",
            text_in_html(&self.note)
        );
        for column in &self.columns {
            let _ = write!(page, "<th scope=\"col\">{}</th>", text_in_html(column));
        }
        page.push_str("</tr>\n</thead>\n<tbody>\n");
        for (heading, cells) in &self.rows {
            let _ = write!(page, "<tr><th scope=\"row\">{}</th>", text_in_html(heading));
            for (picture, text) in cells {
                let _ = write!(page, "<td>{}<span>{}</span></td>", picture.svg(), text_in_html(text));
            }
            page.push_str("</tr>\n");
        }
        page.push_str("</tbody>\n</table>\n</div>\n</body>\n</html>\n");
        page
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::episode::tests::head_on;

    #[test]
    fn a_picture_shows_both_paths_and_the_contact() {
        let picture = Picture::of(&head_on(40.0));
        assert_eq!(picture.svg().matches("<path").count(), 2);
        assert_eq!(picture.svg().matches("class=\"contact\"").count(), 2);
        let clear = Picture::of(&head_on(400.0));
        assert_eq!(clear.svg().matches("class=\"closest\"").count(), 2);
        assert!(!clear.svg().contains("NaN"));
    }

    #[test]
    fn north_is_up_and_east_is_right() {
        let at = |north_m, east_m| Position { north_m, east_m };
        let frame = Frame::around([at(-1000.0, -1000.0), at(1000.0, 1000.0)].into_iter());
        assert_eq!(frame.place(at(1000.0, -1000.0)), (MARGIN_PX, MARGIN_PX));
        assert_eq!(frame.place(at(0.0, 1000.0)), (SIDE_PX - MARGIN_PX, 0.5 * SIDE_PX));
    }

    #[test]
    fn a_page_stands_alone_and_quotes_what_it_is_given() {
        let mut episode = head_on(400.0);
        episode.scenario = "\"><script>".to_owned();
        let page_of = PicturePage {
            title: "Two & two".to_owned(),
            note: String::new(),
            columns: vec!["<b>".to_owned()],
            rows: vec![("1".to_owned(), vec![(Picture::of(&episode), "400 m".to_owned())])],
        };
        let page = page_of.page();
        assert!(page.contains("Two &amp; two") && page.contains("&lt;b&gt;") && page.contains("400 m"));
        for word in ["<script", "<b>", "http", "src=", "href=", "url("] {
            assert!(!page.contains(word), "{word}");
        }
        let figure = page_of.figure();
        assert!(figure.contains("x=\"40\" y=\"18\"") && figure.contains("400 m"), "{figure}");
        assert!(!figure.contains("<script") && !figure.contains("<b>"));
    }
}
