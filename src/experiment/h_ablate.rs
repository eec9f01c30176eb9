//! `h_ablate`: final test return over the length of the history, four agents, two motions (paper,
//! section "Experiments").

use super::curves::{AgentKind, Curve, Group, Waters, commits, counted, thousands};
use super::learning::{OPEN_WATER, style};
use super::product::{DataTable, Drawing, Product, data_row};
use crate::report::figure::{Figure, LegendPlace, Line, Panel, Stroke, Whisker};

/// The lengths that the paper compares.
pub const HISTORY_LENGTHS: [usize; 3] = [4, 7, 10];
/// Agents stand this far apart around a length, so that their intervals do not cover each other.
const APART: f64 = 0.22;
/// The interval of two seeds is some twelve times as wide as they are apart, and tells less than the two do.
const SEEDS_OF_A_BAR: usize = 3;

/// A group that is compared, and its return.
struct Column<'a> {
    waters: Waters,
    history_len: usize,
    group: Group<'a>,
}

/// Draws what there is, at the last step that all runs reached; `None` where there are no runs with two
/// lengths in the same waters.
#[must_use]
pub fn make(curves: &[Curve]) -> Option<Product> {
    let columns: Vec<Column<'_>> = [Waters::Stochastic, Waters::Periodic]
        .into_iter()
        .filter(|&waters| lengths_in(curves, waters) > 1)
        .flat_map(|waters| HISTORY_LENGTHS.map(|history_len| (waters, history_len)))
        .flat_map(|(waters, history_len)| {
            AgentKind::ALL.map(|agent| Column {
                waters,
                history_len,
                group: Group::of(curves, waters, agent, history_len),
            })
        })
        .filter(|column| !column.group.points().is_empty())
        .collect();
    let last = |column: &Column<'_>| column.group.points().last().map(|point| point.step);
    let step = columns.iter().filter_map(last).min()?;

    let mut data = DataTable::new(&[
        "waters",
        "history_len",
        "agent",
        "step",
        "seeds",
        "mean_return",
        "ci95_low",
        "ci95_high",
    ]);
    let mut panels = Vec::new();
    let mut ran = Vec::new();
    for waters in [Waters::Stochastic, Waters::Periodic] {
        let here: Vec<&Column<'_>> = columns.iter().filter(|column| column.waters == waters).collect();
        if here.is_empty() {
            ran.push(format!("{}: not run.", waters.title()));
            continue;
        }
        panels.push(panel(waters, &here, step, &mut data));
        ran.push(format!("{}: {}.", waters.title(), seeds(&here)));
    }
    let curves = columns.iter().flat_map(|column| column.group.curves.iter().copied());
    let caption = format!(
        "Test return after {} training steps over the length l of the history: small marks are single seeds, large \
         ones their means; bars are 95 % t-intervals of the mean from {SEEDS_OF_A_BAR} seeds on. {} {}. The paper: {} \
         seeds, {} steps.",
        thousands(step),
        ran.join(" "),
        capitalised(&commits(curves)),
        OPEN_WATER.seeds,
        thousands(OPEN_WATER.steps)
    );
    let columns = panels.len();
    Some(Product { drawing: Drawing::Figure(Figure { panels, columns }), data, caption })
}

fn lengths_in(curves: &[Curve], waters: Waters) -> usize {
    let is_run = |length: &&usize| {
        curves.iter().any(|curve| curve.run.waters == waters && curve.run.history_len == **length)
    };
    HISTORY_LENGTHS.iter().filter(is_run).count()
}

fn panel(waters: Waters, columns: &[&Column<'_>], step: u64, data: &mut DataTable) -> Panel {
    let (mut lines, mut whiskers) = (Vec::new(), Vec::new());
    for (index, agent) in AgentKind::ALL.into_iter().enumerate() {
        let (colour, stroke) = style(agent);
        let (mut points, mut single) = (Vec::new(), Vec::new());
        for column in columns.iter().filter(|column| column.group.agent == agent) {
            let Some(point) = column.group.points().into_iter().find(|point| point.step == step) else {
                continue;
            };
            let x = column.history_len as f64 + APART * (index as f64 - 1.5);
            points.push((x, point.mean_return.value));
            single.extend(column.group.curves.iter().filter_map(|curve| Some((x, curve.at(step)?))));
            let interval = point.mean_return.interval;
            let bar = interval.filter(|_| column.group.curves.len() >= SEEDS_OF_A_BAR);
            whiskers.extend(bar.map(|at| Whisker { colour, x, low: at.low, high: at.high }));
            data.push(data_row![
                waters.slug(),
                column.history_len,
                agent.label(),
                step,
                column.group.curves.len(),
                point.mean_return.value,
                interval.map(|interval| interval.low),
                interval.map(|interval| interval.high),
            ]);
        }
        if !points.is_empty() {
            let mark = if agent.estimates { Stroke::Dots } else { Stroke::Squares };
            lines.push(Line { stroke, width: 1, ..Line::solid("", colour, points.clone()) });
            lines.push(Line::marks("", colour, mark, 2, single));
            lines.push(Line::marks(agent.label(), colour, mark, 4, points));
        }
    }
    Panel {
        title: waters.title().into(),
        x_label: "length l of the history (observations)".into(),
        y_label: "test return per episode".into(),
        lines,
        whiskers,
        close_up: true,
        legend: LegendPlace::UpperMiddle,
        size_px: Some((520, 460)),
        ..Panel::default()
    }
}

/// `2 seeds each`, or `2 to 3 seeds`.
fn seeds(columns: &[&Column<'_>]) -> String {
    let counts = || columns.iter().map(|column| column.group.curves.len());
    match (counts().min().unwrap_or(0), counts().max().unwrap_or(0)) {
        (least, most) if least == most => format!("{} each", counted(least, "seed")),
        (least, most) => format!("{least} to {most} seeds"),
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Cell;
    use crate::experiment::curves::tests::run;

    #[test]
    fn lengths_are_compared_at_a_step_that_all_reached() {
        let mut curves = Vec::new();
        for agent in AgentKind::ALL {
            for seed in 1..=2 {
                // The runs with the default length are longer: they serve another figure, too.
                curves.push(run(Waters::Periodic, agent, 4, seed, -10.0, 800));
                curves.push(run(Waters::Periodic, agent, 7, seed, -12.0, 500));
                curves.push(run(Waters::Periodic, agent, 10, seed, -15.0, 500));
            }
        }
        let product = make(&curves).unwrap();
        assert_eq!(product.data.rows().len(), 3 * 4);
        assert!(product.data.rows().iter().all(|row| row[3] == Cell::Count(500)));
        assert!(product.caption.contains("after 500 training steps"), "{}", product.caption);
        assert!(product.caption.contains("Stochastic obstacle movement: not run."), "{}", product.caption);
        assert!(product.to_svg().unwrap().contains("length l of the history"));
    }

    #[test]
    fn one_length_is_no_comparison() {
        let curves = [run(Waters::Periodic, AgentKind::ALL[0], 4, 1, -10.0, 800)];
        assert!(make(&curves).is_none());
    }
}
