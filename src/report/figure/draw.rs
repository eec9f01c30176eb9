//! The drawing of one panel.

use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::{Failure, LegendPlace, Line, Panel, Stroke, Whisker};

const FONT: (&str, u32) = ("sans-serif", 14);
const TITLE_FONT: (&str, u32) = ("sans-serif", 17);
const X_LABEL_PX: u32 = 38;
const Y_LABEL_PX: u32 = 58;
const MARGIN_PX: u32 = 10;
/// Length of the dashes of a broken line, and of the gaps between them.
const DASH_PX: (u32, u32) = (7, 4);
/// Half the width of the caps at the ends of an interval.
const CAP_PX: i32 = 3;
const LEGEND_PX: i32 = 18;
/// Part of either axis that a legend in a corner takes.
const CORNER: f64 = 0.3;
/// Points that stand for an interval where a legend looks for room.
const BAR_POINTS: u32 = 8;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b, Y> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, Y>>;

impl Panel {
    pub(super) fn draw(&self, area: &Area<'_>, size_px: (u32, u32)) -> Result<(), Failure> {
        let x = Range::of(self.points().map(|point| point.0)).ok_or("a figure without points")?;
        let y = Range::of(self.points().map(|point| point.1).filter(|&y| !self.logarithmic || y > 0.0))
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
            self.fill(chart, SeriesLabelPosition::UpperRight)
        } else {
            // Marks and intervals at the ends need room beside them.
            let x = if self.whiskers.is_empty() { x } else { x.widened() };
            let (x, y) = match (self.equal_scales, self.close_up) {
                (true, _) => equal(x, y, size_px),
                (false, true) => (x, y.widened()),
                (false, false) => (x, y.padded()),
            };
            let chart = chart.build_cartesian_2d(x.low..x.high, y.low..y.high).map_err(failure)?;
            self.fill(chart, self.emptiest_corner(x, y))
        }
    }

    /// Everything that the axes have to reach.
    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let lines = self.lines.iter().flat_map(|line| line.points.iter().copied());
        let bands = self.bands.iter().flat_map(|band| &band.points);
        let whiskers = self.whiskers.iter().flat_map(|bar| [(bar.x, bar.low), (bar.x, bar.high)]);
        lines.chain(bands.flat_map(|&(x, low, high)| [(x, low), (x, high)])).chain(whiskers)
    }

    /// The corner that the fewest points lie in; of equals the first in reading order.
    fn emptiest_corner(&self, x: Range, y: Range) -> SeriesLabelPosition {
        let part = |value: f64, range: Range| (value - range.low) / (range.high - range.low);
        let along = |bar: &Whisker| {
            let (x, low, high) = (bar.x, bar.low, bar.high);
            (0..=BAR_POINTS).map(move |k| (x, low + (high - low) * f64::from(k) / f64::from(BAR_POINTS)))
        };
        let all = || self.points().chain(self.whiskers.iter().flat_map(along));
        let points = || all().map(|(at_x, at_y)| (part(at_x, x), part(at_y, y)));
        let count = |is_in: fn((f64, f64)) -> bool| points().filter(|&point| is_in(point)).count();
        let corners = [
            (SeriesLabelPosition::UpperLeft, count(|(x, y)| x < CORNER && y > 1.0 - CORNER)),
            (SeriesLabelPosition::UpperRight, count(|(x, y)| x > 1.0 - CORNER && y > 1.0 - CORNER)),
            (SeriesLabelPosition::LowerLeft, count(|(x, y)| x < CORNER && y < CORNER)),
            (SeriesLabelPosition::LowerRight, count(|(x, y)| x > 1.0 - CORNER && y < CORNER)),
        ];
        let emptiest = corners.into_iter().min_by_key(|(_, points)| *points);
        emptiest.map_or(SeriesLabelPosition::UpperLeft, |(corner, _)| corner)
    }

    fn fill<'a, 'b: 'a, Y>(
        &self,
        mut chart: Chart<'a, 'b, Y>,
        emptiest: SeriesLabelPosition,
    ) -> Result<(), Failure>
    where
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_labels(6)
            .y_labels(6)
            .x_label_formatter(&tick)
            .y_label_formatter(&tick)
            .label_style(FONT)
            .axis_desc_style(FONT)
            .draw()
            .map_err(failure)?;
        for band in &self.bands {
            let upper = band.points.iter().map(|&(x, _, high)| (x, high));
            let lower = band.points.iter().rev().map(|&(x, low, _)| (x, low));
            let outline: Vec<_> = upper.chain(lower).collect();
            let shape = Polygon::new(outline, band.colour.mix(0.18));
            chart.draw_series(std::iter::once(shape)).map_err(failure)?;
        }
        for bar in &self.whiskers {
            let stroke = bar.colour.stroke_width(1);
            let cap = |y: f64| {
                EmptyElement::at((bar.x, y)) + PathElement::new(vec![(-CAP_PX, 0), (CAP_PX, 0)], stroke)
            };
            let stem = PathElement::new(vec![(bar.x, bar.low), (bar.x, bar.high)], stroke);
            chart.draw_series(std::iter::once(stem)).map_err(failure)?;
            chart.draw_series([cap(bar.low), cap(bar.high)]).map_err(failure)?;
        }
        for line in &self.lines {
            draw_line(line, &mut chart)?;
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
                    LegendPlace::UpperRight => SeriesLabelPosition::UpperRight,
                    LegendPlace::LowerRight => SeriesLabelPosition::LowerRight,
                    LegendPlace::LowerLeft => SeriesLabelPosition::LowerLeft,
                    LegendPlace::Emptiest => emptiest,
                })
                .draw()
                .map_err(failure)?;
        }
        Ok(())
    }
}

fn draw_line<'a, 'b: 'a, Y>(line: &Line, chart: &mut Chart<'a, 'b, Y>) -> Result<(), Failure>
where
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let Line { colour, stroke, width, .. } = *line;
    let points = || line.points.iter().copied();
    let style = colour.stroke_width(width);
    let series = match stroke {
        Stroke::Solid => chart.draw_series(LineSeries::new(points(), style)),
        Stroke::Dashed => {
            let points: Vec<_> = points().collect();
            let dashes = DashedPathElement::new(points, DASH_PX.0, DASH_PX.1, style);
            chart.draw_series(std::iter::once(dashes))
        }
        Stroke::Dots => chart.draw_series(points().map(|at| Circle::new(at, width, colour.filled()))),
        Stroke::Rings => chart.draw_series(points().map(|at| Circle::new(at, width, colour.stroke_width(2)))),
        Stroke::Squares => {
            let corner = width as i32;
            let square = move |at| {
                EmptyElement::at(at) + Rectangle::new([(-corner, -corner), (corner, corner)], colour.filled())
            };
            chart.draw_series(points().map(square))
        }
    };
    let series = series.map_err(failure)?;
    if line.label.is_empty() {
        return Ok(());
    }
    series.label(&line.label).legend(move |(x, y)| {
        let ends = vec![(x, y), (x + LEGEND_PX, y)];
        let centre = (x + LEGEND_PX / 2, y);
        let corner = (width as i32).min(5);
        match stroke {
            Stroke::Solid => PathElement::new(ends, style).into_dyn(),
            Stroke::Dashed => DashedPathElement::new(ends, DASH_PX.0, DASH_PX.1, style).into_dyn(),
            Stroke::Dots => Circle::new(centre, width.min(5), colour.filled()).into_dyn(),
            Stroke::Rings => Circle::new(centre, width.min(5), colour.stroke_width(2)).into_dyn(),
            Stroke::Squares => {
                let corners = [(centre.0 - corner, y - corner), (centre.0 + corner, y + corner)];
                Rectangle::new(corners, colour.filled()).into_dyn()
            }
        }
    });
    Ok(())
}

/// A number at an axis, without digits that say nothing.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature is that of plotters")]
fn tick(value: &f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    // Adding 0 takes the sign from a negative zero.
    format!("{}", rounded + 0.0)
}

pub(super) fn failure(error: impl std::fmt::Display) -> Failure {
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
fn equal(x: Range, y: Range, size_px: (u32, u32)) -> (Range, Range) {
    let (width_px, height_px) = inner_px(size_px);
    let per_px = 1.1 * ((x.high - x.low) / width_px).max((y.high - y.low) / height_px);
    (x.around(per_px * width_px), y.around(per_px * height_px))
}

/// What axes, margins and title leave of a panel.
fn inner_px(size_px: (u32, u32)) -> (f64, f64) {
    let taken_px = (Y_LABEL_PX + 2 * MARGIN_PX, X_LABEL_PX + 2 * MARGIN_PX + TITLE_FONT.1 * 2);
    (f64::from(size_px.0 - taken_px.0), f64::from(size_px.1 - taken_px.1))
}

#[cfg(test)]
mod tests {
    use super::super::PANEL_PX;
    use super::*;

    #[test]
    fn a_map_has_equal_scales() {
        let (x, y) = equal(Range { low: 0.0, high: 100.0 }, Range { low: 0.0, high: 10.0 }, PANEL_PX);
        let (width_px, height_px) = inner_px(PANEL_PX);
        assert!(((x.high - x.low) / width_px - (y.high - y.low) / height_px).abs() < 1e-9);
        assert!(y.low < -20.0 && y.high > 30.0);
    }

    #[test]
    fn a_legend_finds_the_corner_without_points() {
        let unit = Range { low: 0.0, high: 1.0 };
        let falling = (0..=20).map(|k| f64::from(k) / 20.0).map(|x| (x, 1.0 - x)).collect();
        let mut panel = Panel { lines: vec![Line::solid("", BLACK_LINE, falling)], ..Panel::default() };
        assert!(matches!(panel.emptiest_corner(unit, unit), SeriesLabelPosition::UpperRight));
        panel.lines.push(Line::dots("", BLACK_LINE, vec![(0.9, 0.9)]));
        assert!(matches!(panel.emptiest_corner(unit, unit), SeriesLabelPosition::LowerLeft));
    }

    const BLACK_LINE: RGBColor = RGBColor(0, 0, 0);
}
