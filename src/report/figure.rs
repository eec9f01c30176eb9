//! Line figures as SVG text: one look for all of them.

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// Colours that stay apart in print and for colour-blind readers (Okabe & Ito 2008).
pub mod colour {
    use plotters::style::RGBColor;

    /// What is measured or true.
    pub const BLUE: RGBColor = RGBColor(0, 114, 178);
    /// What is predicted.
    pub const ORANGE: RGBColor = RGBColor(230, 97, 0);
    /// What was observed.
    pub const GREEN: RGBColor = RGBColor(0, 158, 115);
    /// A further series.
    pub const PURPLE: RGBColor = RGBColor(170, 80, 150);
    /// What only serves comparison.
    pub const GREY: RGBColor = RGBColor(120, 120, 120);
}

/// One series of points.
#[derive(Debug, Clone)]
pub struct Line {
    /// Its name in the legend; none of that name if empty.
    pub label: String,
    /// Its points, in data units.
    pub points: Vec<(f64, f64)>,
    /// Its colour.
    pub colour: RGBColor,
    /// Whether only its points are drawn, as dots.
    pub dotted: bool,
    /// Width of the stroke in pixels.
    pub width: u32,
}

impl Line {
    /// A solid line.
    pub fn solid(label: impl Into<String>, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self { label: label.into(), points, colour, dotted: false, width: 2 }
    }

    /// A row of dots.
    pub fn dots(label: impl Into<String>, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self { dotted: true, ..Self::solid(label, colour, points) }
    }
}

/// One system of axes.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Below the horizontal axis, with its unit.
    pub x_label: String,
    /// Beside the vertical axis, with its unit.
    pub y_label: String,
    /// What is drawn.
    pub lines: Vec<Line>,
    /// A map: a metre is as long on either axis.
    pub equal_scales: bool,
    /// The vertical axis is logarithmic.
    pub logarithmic: bool,
    /// The vertical axis spans the data only, also where that leaves zero out.
    pub close_up: bool,
    /// Where the legend stands.
    pub legend: LegendPlace,
}

/// Where a legend stands, so that it covers no line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LegendPlace {
    /// In the upper left corner.
    #[default]
    UpperLeft,
    /// In the middle of the upper edge.
    UpperMiddle,
}

/// Panels side by side, `columns` in a row.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels in a row.
    pub columns: usize,
}

const PANEL_PX: (u32, u32) = (460, 360);
const FONT: (&str, u32) = ("sans-serif", 14);
const TITLE_FONT: (&str, u32) = ("sans-serif", 17);
const X_LABEL_PX: u32 = 38;
const Y_LABEL_PX: u32 = 58;
const MARGIN_PX: u32 = 10;

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Failure = Box<dyn std::error::Error + Send + Sync>;

impl Figure {
    /// The figure as SVG text.
    ///
    /// # Errors
    ///
    /// When a panel has no finite point to draw.
    pub fn to_svg(&self) -> Result<String, Failure> {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns);
        let size = (PANEL_PX.0 * columns as u32, PANEL_PX.1 * rows as u32);
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            root.fill(&WHITE).map_err(failure)?;
            for (panel, area) in self.panels.iter().zip(root.split_evenly((rows, columns))) {
                panel.draw(&area)?;
            }
            root.present().map_err(failure)?;
        }
        Ok(svg)
    }
}

impl Panel {
    fn draw(&self, area: &Area<'_>) -> Result<(), Failure> {
        let points = || self.lines.iter().flat_map(|line| line.points.iter().copied());
        let x = Range::of(points().map(|point| point.0)).ok_or("a figure without points")?;
        let y = Range::of(points().map(|point| point.1).filter(|&y| !self.logarithmic || y > 0.0))
            .ok_or("a figure without points")?;
        let mut chart = ChartBuilder::on(area);
        chart
            .caption(&self.title, TITLE_FONT)
            .margin(MARGIN_PX)
            .x_label_area_size(X_LABEL_PX)
            .y_label_area_size(Y_LABEL_PX);
        if self.logarithmic {
            let chart = chart
                .build_cartesian_2d(x.low..x.high, (y.low * 0.9..y.high * 1.1).log_scale())
                .map_err(failure)?;
            self.fill(chart)
        } else {
            let (x, y) = match (self.equal_scales, self.close_up) {
                (true, _) => equal(x, y),
                (false, true) => (x, y.widened()),
                (false, false) => (x, y.padded()),
            };
            let chart = chart.build_cartesian_2d(x.low..x.high, y.low..y.high).map_err(failure)?;
            self.fill(chart)
        }
    }

    fn fill<'a, 'b: 'a, Y>(
        &self,
        mut chart: ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, Y>>,
    ) -> Result<(), Failure>
    where
        Y: Ranged<ValueType = f64> + plotters::coord::ranged1d::ValueFormatter<f64>,
    {
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_labels(6)
            .y_labels(6)
            .label_style(FONT)
            .axis_desc_style(FONT)
            .draw()
            .map_err(failure)?;
        for line in &self.lines {
            let (colour, width) = (line.colour, line.width);
            let series = if line.dotted {
                let dots = line.points.iter().map(|&point| Circle::new(point, width, colour.filled()));
                chart.draw_series(dots).map_err(failure)?
            } else {
                let stroke = colour.stroke_width(width);
                chart.draw_series(LineSeries::new(line.points.iter().copied(), stroke)).map_err(failure)?
            };
            if !line.label.is_empty() {
                series.label(&line.label).legend(move |(x, y)| {
                    PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(width))
                });
            }
        }
        if self.lines.iter().any(|line| !line.label.is_empty()) {
            chart
                .configure_series_labels()
                .background_style(WHITE.mix(0.85))
                .border_style(BLACK.mix(0.2))
                .label_font(FONT)
                .position(match self.legend {
                    LegendPlace::UpperLeft => SeriesLabelPosition::UpperLeft,
                    LegendPlace::UpperMiddle => SeriesLabelPosition::UpperMiddle,
                })
                .draw()
                .map_err(failure)?;
        }
        Ok(())
    }
}

fn failure(error: impl std::fmt::Display) -> Failure {
    error.to_string().into()
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    /// Of the finite values; never of no length.
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let finite = values.filter(|value| value.is_finite());
        let range = finite.fold(None, |range: Option<Self>, value| {
            let Self { low, high } = range.unwrap_or(Self { low: value, high: value });
            Some(Self { low: low.min(value), high: high.max(value) })
        })?;
        Some(if range.high > range.low { range } else { Self { high: range.low + 1.0, ..range } })
    }

    fn widened(self) -> Self {
        let margin = 0.05 * (self.high - self.low);
        Self { low: self.low - margin, high: self.high + margin }
    }

    fn padded(self) -> Self {
        let widened = self.widened();
        Self { low: if self.low >= 0.0 { 0.0 } else { widened.low }, ..widened }
    }

    fn around(self, length: f64) -> Self {
        let middle = 0.5 * (self.low + self.high);
        Self { low: middle - 0.5 * length, high: middle + 0.5 * length }
    }
}

/// Widens one of two ranges so that a unit has the same length on either axis of a panel.
fn equal(x: Range, y: Range) -> (Range, Range) {
    let width_px = f64::from(PANEL_PX.0 - Y_LABEL_PX - 2 * MARGIN_PX);
    let height_px = f64::from(PANEL_PX.1 - X_LABEL_PX - 2 * MARGIN_PX - TITLE_FONT.1 * 2);
    let per_px = 1.1 * ((x.high - x.low) / width_px).max((y.high - y.low) / height_px);
    (x.around(per_px * width_px), y.around(per_px * height_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(points: Vec<(f64, f64)>) -> Panel {
        Panel {
            title: "Error over the horizon".into(),
            x_label: "time (min)".into(),
            y_label: "error (m)".into(),
            lines: vec![Line::solid("median", colour::BLUE, points)],
            ..Panel::default()
        }
    }

    #[test]
    fn a_figure_names_its_axes_and_series() {
        let figure = Figure { panels: vec![panel(vec![(0.0, 1.0), (1.0, 2.0)]); 3], columns: 2 };
        let svg = figure.to_svg().unwrap();
        for text in ["Error over the horizon", "time (min)", "error (m)", "median"] {
            assert_eq!(svg.matches(text).count(), 3, "{text}");
        }
        assert!(svg.contains("width=\"920\" height=\"720\""), "{}", &svg[..200]);
    }

    #[test]
    fn an_empty_panel_is_an_error() {
        let figure = Figure { panels: vec![panel(vec![(f64::NAN, 1.0)])], columns: 1 };
        assert!(figure.to_svg().is_err());
    }

    #[test]
    fn a_map_has_equal_scales() {
        let (x, y) = equal(Range { low: 0.0, high: 100.0 }, Range { low: 0.0, high: 10.0 });
        let width_px = f64::from(PANEL_PX.0 - Y_LABEL_PX - 2 * MARGIN_PX);
        let height_px = f64::from(PANEL_PX.1 - X_LABEL_PX - 2 * MARGIN_PX - TITLE_FONT.1 * 2);
        assert!(((x.high - x.low) / width_px - (y.high - y.low) / height_px).abs() < 1e-9);
        assert!(y.low < -20.0 && y.high > 30.0);
    }
}
