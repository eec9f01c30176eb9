//! Line figures as SVG text: one look for all of them.

mod draw;

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
    /// What must not be overlooked.
    pub const BLACK: RGBColor = RGBColor(0, 0, 0);
}

/// How a series of points is drawn. Strokes and marks tell series apart where colours do not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Stroke {
    /// A line through the points.
    #[default]
    Solid,
    /// A broken line through the points.
    Dashed,
    /// The points only, as discs.
    Dots,
    /// The points only, as rings.
    Rings,
    /// The points only, as filled squares.
    Squares,
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
    /// How it is drawn.
    pub stroke: Stroke,
    /// Width of the stroke, or radius of the marks, in pixels.
    pub width: u32,
}

impl Line {
    /// A solid line.
    pub fn solid(label: impl Into<String>, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self { label: label.into(), points, colour, stroke: Stroke::Solid, width: 2 }
    }

    /// A broken line.
    pub fn dashed(label: impl Into<String>, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self { stroke: Stroke::Dashed, ..Self::solid(label, colour, points) }
    }

    /// A row of dots.
    pub fn dots(label: impl Into<String>, colour: RGBColor, points: Vec<(f64, f64)>) -> Self {
        Self { stroke: Stroke::Dots, ..Self::solid(label, colour, points) }
    }

    /// A row of marks of this kind and radius.
    pub fn marks(
        label: impl Into<String>,
        colour: RGBColor,
        stroke: Stroke,
        radius_px: u32,
        points: Vec<(f64, f64)>,
    ) -> Self {
        Self { stroke, width: radius_px, ..Self::solid(label, colour, points) }
    }
}

/// A shaded stretch between two curves, such as an interval around a line.
#[derive(Debug, Clone)]
pub struct Band {
    /// Its colour, drawn transparent.
    pub colour: RGBColor,
    /// Place on the horizontal axis, lower and upper end, in data units.
    pub points: Vec<(f64, f64, f64)>,
}

/// An interval as a vertical bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whisker {
    /// Its colour.
    pub colour: RGBColor,
    /// Place on the horizontal axis, in data units.
    pub x: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
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
    /// Shaded below the lines.
    pub bands: Vec<Band>,
    /// Intervals around points.
    pub whiskers: Vec<Whisker>,
    /// A map: a metre is as long on either axis.
    pub equal_scales: bool,
    /// The vertical axis is logarithmic.
    pub logarithmic: bool,
    /// The vertical axis spans the data only, also where that leaves zero out.
    pub close_up: bool,
    /// Where the legend stands.
    pub legend: LegendPlace,
    /// Width and height in pixels; those of an ordinary panel if not given. A figure gives every panel
    /// the largest that one of them asks for.
    pub size_px: Option<(u32, u32)>,
}

/// Where a legend stands, so that it covers no line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LegendPlace {
    /// In the upper left corner.
    #[default]
    UpperLeft,
    /// In the middle of the upper edge.
    UpperMiddle,
    /// In the upper right corner.
    UpperRight,
    /// In the lower right corner.
    LowerRight,
    /// In the lower left corner.
    LowerLeft,
    /// In the corner with the fewest points of lines.
    Emptiest,
}

/// Panels side by side, `columns` in a row.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// The panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels in a row.
    pub columns: usize,
}

/// Why a figure could not be drawn.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

impl Figure {
    /// One panel.
    #[must_use]
    pub fn single(panel: Panel) -> Self {
        Self { panels: vec![panel], columns: 1 }
    }

    /// The figure as SVG text.
    ///
    /// # Errors
    ///
    /// When a panel has no finite point to draw.
    pub fn to_svg(&self) -> Result<String, Failure> {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns);
        let sizes = || self.panels.iter().map(|panel| panel.size_px.unwrap_or(PANEL_PX));
        let panel_px = (
            sizes().map(|size| size.0).max().unwrap_or(PANEL_PX.0),
            sizes().map(|size| size.1).max().unwrap_or(PANEL_PX.1),
        );
        let size = (panel_px.0 * columns as u32, panel_px.1 * rows as u32);
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            root.fill(&WHITE).map_err(draw::failure)?;
            for (panel, area) in self.panels.iter().zip(root.split_evenly((rows, columns))) {
                panel.draw(&area, panel_px)?;
            }
            root.present().map_err(draw::failure)?;
        }
        Ok(svg)
    }
}

/// Width and height of an ordinary panel.
const PANEL_PX: (u32, u32) = (460, 360);

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
    fn every_stroke_band_and_interval_is_drawn() {
        let points = || vec![(0.0, 1.0), (1.0, 2.0), (2.0, 1.5)];
        let marks = |stroke| Line::marks("", colour::GREEN, stroke, 4, points());
        let with = |lines| Figure::single(Panel { lines, ..Panel::default() }).to_svg().unwrap();
        let solid = with(vec![Line::solid("", colour::BLUE, points())]);
        let dashed = with(vec![Line::dashed("", colour::BLUE, points())]);
        assert!(dashed.matches("<polyline").count() > solid.matches("<polyline").count() + 10);
        assert_eq!(with(vec![marks(Stroke::Dots)]).matches("<circle").count(), 3);
        let rings = with(vec![marks(Stroke::Rings)]);
        assert_eq!((rings.matches("<circle").count(), rings.matches("fill=\"none\"").count() > 2), (3, true));
        // One rectangle is the background.
        assert_eq!(with(vec![marks(Stroke::Squares)]).matches("<rect").count(), 4);

        let band = Band { colour: colour::BLUE, points: vec![(0.0, -9.0, 9.0), (1.0, -9.0, 9.0)] };
        let whisker = Whisker { colour: colour::BLUE, x: 1.0, low: -30.0, high: 30.0 };
        let panel = panel(points());
        let svg =
            Figure::single(Panel { bands: vec![band], whiskers: vec![whisker], ..panel }).to_svg().unwrap();
        assert_eq!(svg.matches("<polygon").count(), 1);
        assert!(svg.contains("\n-20\n") && svg.contains("\n20\n"), "the axis reaches the interval");
    }

    #[test]
    fn a_wide_panel_makes_the_figure_wide() {
        let wide = Panel { size_px: Some((900, 300)), ..panel(vec![(0.0, 1.0), (1.0, 2.0)]) };
        let svg = Figure::single(wide).to_svg().unwrap();
        assert!(svg.contains("width=\"900\" height=\"300\""), "{}", &svg[..200]);
    }
}
