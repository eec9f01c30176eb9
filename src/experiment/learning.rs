//! Return over training steps: the drawing that `trainResults` and `AIS_results` share.

use super::curves::{AgentKind, Curve, Group, Waters, commits, counted, thousands};
use super::product::{DataTable, data_row};
use crate::report::figure::{Band, LegendPlace, Line, Panel, Stroke, colour};
use crate::rl::agent::{AgentConfig, Algorithm};
use plotters::style::RGBColor;

/// How long and how often the paper trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PaperTraining {
    /// Steps of a run.
    pub steps: u64,
    /// Runs, each with a seed of its own.
    pub seeds: u64,
}

/// The paper's runs in open water.
pub const OPEN_WATER: PaperTraining = PaperTraining { steps: 1_500_000, seeds: 10 };
/// The paper's runs in coastal waters.
pub const COASTAL: PaperTraining = PaperTraining { steps: 1_000_000, seeds: 15 };

/// Columns of the data behind these figures.
pub(super) const COLUMNS: [&str; 7] =
    ["waters", "agent", "step", "seeds", "mean_return", "ci95_low", "ci95_high"];

/// Colour and stroke of an agent: the colour tells the algorithm, a broken line the baseline.
pub(super) fn style(agent: AgentKind) -> (RGBColor, Stroke) {
    let colour = match (agent.algorithm, agent.estimates) {
        (Algorithm::LstmTd3, true) => colour::BLUE,
        (Algorithm::LstmSac, true) => colour::ORANGE,
        (Algorithm::LstmTd3, false) => colour::GREEN,
        (Algorithm::LstmSac, false) => colour::PURPLE,
    };
    (colour, if agent.estimates { Stroke::Solid } else { Stroke::Dashed })
}

/// The groups of the four agents in these waters, at the default history; those never run are not
/// among them.
pub(super) fn groups(curves: &[Curve], waters: Waters) -> Vec<Group<'_>> {
    let history_len = AgentConfig::default().history_len;
    let all = AgentKind::ALL.into_iter().map(|agent| Group::of(curves, waters, agent, history_len));
    all.filter(|group| !group.points().is_empty()).collect()
}

/// Mean return over seeds with its interval, a line for each group.
pub(super) fn panel(waters: Waters, groups: &[Group<'_>]) -> Panel {
    let (mut lines, mut bands) = (Vec::new(), Vec::new());
    for group in groups {
        let (colour, stroke) = style(group.agent);
        let points = group.points();
        let of = |step: u64| step as f64 / 1000.0;
        let means = points.iter().map(|point| (of(point.step), point.mean_return.value)).collect();
        let band = points.iter().filter_map(|point| {
            let interval = point.mean_return.interval?;
            Some((of(point.step), interval.low, interval.high))
        });
        bands.push(Band { colour, points: band.collect() });
        lines.push(Line { stroke, ..Line::solid(group.agent.label(), colour, means) });
    }
    bands.retain(|band| !band.points.is_empty());
    Panel {
        title: waters.title().into(),
        x_label: "training steps (thousands)".into(),
        y_label: "test return per episode".into(),
        lines,
        bands,
        close_up: true,
        legend: LegendPlace::Emptiest,
        ..Panel::default()
    }
}

/// The numbers of a panel.
pub(super) fn add_rows(data: &mut DataTable, waters: Waters, groups: &[Group<'_>]) {
    for group in groups {
        for point in group.points() {
            let interval = point.mean_return.interval;
            data.push(data_row![
                waters.slug(),
                group.agent.label(),
                point.step,
                group.curves.len(),
                point.mean_return.value,
                interval.map(|interval| interval.low),
                interval.map(|interval| interval.high),
            ]);
        }
    }
}

/// What was run for the groups of some waters, and what of the paper's was not.
pub(super) fn ran(waters: Waters, groups: &[Group<'_>], paper: PaperTraining) -> String {
    let there: Vec<String> = groups.iter().map(Group::description).collect();
    let missing: Vec<&str> = AgentKind::ALL
        .iter()
        .filter(|agent| groups.iter().all(|group| group.agent != **agent))
        .map(|agent| agent.label())
        .collect();
    let missing =
        if missing.is_empty() { String::new() } else { format!("; not run: {}", missing.join(", ")) };
    let curves = groups.iter().flat_map(|group| group.curves.iter().copied());
    format!(
        "{}: {}{missing}; {}. The paper: {}, {} steps.",
        waters.title(),
        there.join("; "),
        commits(curves),
        counted(paper.seeds as usize, "seed"),
        thousands(paper.steps)
    )
}

/// What lines and bands are.
pub(super) const HOW: &str = "Mean over seeds of the return of deterministic test episodes; the band is the \
point-wise 95 % t-interval over seeds (none with one seed). The prefix SL marks agents that see estimates of the \
collision risk.";
