//! What an experiment makes: a drawing, the numbers in it, and a caption that says where they are from.

use std::fmt::Write as _;
use std::io::{self, Write};

use crate::report::figure::{Failure, Figure};
use crate::report::xml_escaped;

/// A figure with its data and caption.
#[derive(Debug, Clone)]
pub struct Product {
    /// What is drawn.
    pub drawing: Drawing,
    /// The numbers behind it.
    pub data: DataTable,
    /// What is shown, and what was run for it.
    pub caption: String,
}

/// A drawing in one of two forms.
#[derive(Debug, Clone)]
pub enum Drawing {
    /// Panels with axes.
    Figure(Figure),
    /// Ready SVG text, whose root element states `width` and `height` in pixels.
    Svg(String),
}

/// Font size of captions, in pixels, and about how wide a character is.
const CAPTION_PX: (f64, f64) = (13.0, 7.4);
const LINE_PX: f64 = 18.0;
const MARGIN_PX: f64 = 14.0;

impl Product {
    /// The drawing with the caption below it.
    ///
    /// # Errors
    ///
    /// When a panel has no finite point to draw.
    pub fn to_svg(&self) -> Result<String, Failure> {
        let inner = match &self.drawing {
            Drawing::Figure(figure) => figure.to_svg()?,
            Drawing::Svg(svg) => svg.clone(),
        };
        let (width_px, height_px) = size_px(&inner).ok_or("a drawing without width and height")?;
        let per_line = ((width_px - 2.0 * MARGIN_PX) / CAPTION_PX.1).max(20.0) as usize;
        let lines = wrapped(&self.caption, per_line);
        let whole_px = height_px + MARGIN_PX + LINE_PX * lines.len() as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width_px}\" height=\"{whole_px}\" \
             viewBox=\"0 0 {width_px} {whole_px}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        svg.push_str(inner.trim_start_matches(|from: char| from != '<'));
        let _ =
            writeln!(svg, "\n<g font-family=\"sans-serif\" font-size=\"{}\" fill=\"#24323f\">", CAPTION_PX.0);
        for (index, line) in lines.iter().enumerate() {
            let y_px = height_px + LINE_PX * (index + 1) as f64 - 4.0;
            let _ = writeln!(svg, "<text x=\"{MARGIN_PX}\" y=\"{y_px}\">{}</text>", xml_escaped(line));
        }
        svg.push_str("</g>\n</svg>\n");
        Ok(svg)
    }
}

/// Width and height that the root element states.
fn size_px(svg: &str) -> Option<(f64, f64)> {
    let root = &svg[svg.find("<svg")?..];
    let root = &root[..root.find('>')?];
    let value = |name: &str| -> Option<f64> {
        let text = &root[root.find(name)? + name.len()..];
        text[..text.find('"')?].parse().ok()
    };
    Some((value(" width=\"")?, value(" height=\"")?))
}

/// The words of a text on lines of at most so many characters; a longer word has a line of its own.
fn wrapped(text: &str, per_line: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= per_line => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A value in a table of data.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Not known, or not defined.
    Empty,
    /// A name.
    Text(String),
    /// A whole number.
    Count(u64),
    /// A number.
    Number(f64),
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        if value.is_finite() { Self::Number(value) } else { Self::Empty }
    }
}

impl From<u64> for Cell {
    fn from(value: u64) -> Self {
        Self::Count(value)
    }
}

impl From<usize> for Cell {
    fn from(value: usize) -> Self {
        Self::Count(value as u64)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

/// Rows under named columns.
#[derive(Debug, Clone, PartialEq)]
pub struct DataTable {
    columns: Vec<&'static str>,
    rows: Vec<Vec<Cell>>,
}

impl DataTable {
    /// No rows yet; every column carries its unit in its name.
    #[must_use]
    pub fn new(columns: &[&'static str]) -> Self {
        Self { columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    ///
    /// When it has not as many cells as there are columns.
    pub fn push<const N: usize>(&mut self, row: [Cell; N]) {
        assert_eq!(row.len(), self.columns.len(), "a row has a cell for every column");
        self.rows.push(row.into());
    }

    /// The names of the columns.
    #[must_use]
    pub fn columns(&self) -> &[&'static str] {
        &self.columns
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[Vec<Cell>] {
        &self.rows
    }

    /// Writes the table as CSV.
    ///
    /// # Errors
    ///
    /// When `out` cannot be written to.
    pub fn write_csv(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut writer = csv::Writer::from_writer(out);
        writer.write_record(&self.columns)?;
        for row in &self.rows {
            writer.write_record(row.iter().map(|cell| match cell {
                Cell::Empty => String::new(),
                Cell::Text(text) => text.clone(),
                Cell::Count(count) => count.to_string(),
                Cell::Number(number) => number.to_string(),
            }))?;
        }
        writer.flush()
    }
}

/// A row of cells from values of any kind that a cell can hold.
macro_rules! data_row {
    ($($value:expr),* $(,)?) => { [$($crate::experiment::Cell::from($value)),*] };
}
pub(crate) use data_row;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::{Line, Panel, colour};

    fn product(caption: &str) -> Product {
        let line = Line::solid("", colour::BLUE, vec![(0.0, 0.0), (1.0, 1.0)]);
        let figure = Figure::single(Panel { lines: vec![line], ..Panel::default() });
        let data = DataTable::new(&["x", "y"]);
        Product { drawing: Drawing::Figure(figure), data, caption: caption.to_owned() }
    }

    #[test]
    fn the_caption_stands_below_on_as_many_lines_as_it_takes() {
        let short = product("Two seeds & <few> steps.").to_svg().unwrap();
        assert!(short.contains("Two seeds &amp; &lt;few&gt; steps."));
        assert!(short.contains("width=\"460\" height=\"392\""), "{}", &short[..200]);
        let long = product(&"word ".repeat(100)).to_svg().unwrap();
        let lines = long.matches("word word").count() > 6;
        assert!(lines && !long.contains("height=\"392\""));
        assert_eq!(long.matches("<svg").count(), 2, "the drawing is nested whole");
    }

    #[test]
    fn lines_keep_to_their_length_and_lose_no_word() {
        let text = "the quick brown fox incomprehensibilities end";
        let lines = wrapped(text, 12);
        assert_eq!(lines, ["the quick", "brown fox", "incomprehensibilities", "end"]);
        assert_eq!(lines.join(" "), text);
        assert!(wrapped("", 12).is_empty());
    }

    #[test]
    fn a_table_is_written_with_gaps_where_nothing_is_known() {
        let mut table = DataTable::new(&["agent", "step", "mean_return", "low"]);
        table.push(data_row!["a, b", 5_u64, -1.5, None::<f64>]);
        table.push(data_row!["c", 6_usize, f64::NAN, Some(2.0)]);
        let mut bytes = Vec::new();
        table.write_csv(&mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(text, "agent,step,mean_return,low\n\"a, b\",5,-1.5,\nc,6,,2\n");
    }
}
