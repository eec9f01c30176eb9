//! `noise_analysis`: collision rate over the sensor noise, each policy and scenario (paper, section
//! "Results" of the maritime study).

use plotters::style::RGBColor;
use serde::Deserialize;

use super::curves::AgentKind;
use super::learning::style;
use super::product::{DataTable, Drawing, Product, data_row};
use crate::report::figure::{Figure, LegendPlace, Line, Panel, Stroke, Whisker, colour};

/// A row of what `searoom benchmark noise --json` prints.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct NoiseRow {
    /// Who steers.
    pub policy: String,
    /// The scenario.
    pub scenario: String,
    /// Standard deviation of the sensor noise, in metres.
    pub sigma_m: f64,
    /// Episodes.
    pub episodes: u64,
    /// Episodes with contact.
    pub collisions: u64,
    /// Their proportion.
    pub rate: f64,
    /// Its interval.
    pub ci95: [f64; 2],
    /// Mean return.
    pub mean_return: f64,
    /// `agent` or `classical`, where it says so.
    #[serde(default)]
    pub kind: Option<String>,
    /// What an agent was told of the future: `truth` in the rows that are a diagnosis.
    #[serde(default)]
    pub estimates: Option<String>,
}

/// Policies stand this far apart around a noise level, in metres.
const APART_M: f64 = 0.35;

/// A panel for each scenario with the agents, or with the classical policies where there are none; rows on the
/// true future are in the data only. `None` without rows.
#[must_use]
pub fn make(rows: &[NoiseRow]) -> Option<Product> {
    let is_agent = |row: &NoiseRow| row.kind.as_deref() == Some("agent");
    let has_agents = rows.iter().any(is_agent);
    let is_shown =
        |row: &&NoiseRow| row.estimates.as_deref() != Some("truth") && (is_agent(row) || !has_agents);
    let shown: Vec<&NoiseRow> = rows.iter().filter(is_shown).collect();
    let scenarios = distinct(shown.iter().map(|row| row.scenario.as_str()));
    let policies = distinct(shown.iter().map(|row| row.policy.as_str()));
    let mut data = DataTable::new(&[
        "policy",
        "scenario",
        "sigma_m",
        "episodes",
        "collisions",
        "rate",
        "ci95_low",
        "ci95_high",
        "mean_return",
    ]);
    for row in rows {
        data.push(data_row![
            row.policy.as_str(),
            row.scenario.as_str(),
            row.sigma_m,
            row.episodes,
            row.collisions,
            row.rate,
            row.ci95[0],
            row.ci95[1],
            row.mean_return,
        ]);
    }
    let panels: Vec<Panel> = scenarios.iter().map(|scenario| panel(&shown, scenario, &policies)).collect();
    let least = rows.iter().map(|row| row.episodes).min()?;
    let most = rows.iter().map(|row| row.episodes).max()?;
    let episodes = if least == most { least.to_string() } else { format!("{least} to {most}") };
    let columns = panels.len().min(2);
    let caption = format!(
        "Episodes with contact of collision circles over the standard deviation of the noise on sensed positions: {episodes} \
         seeded episodes for each policy, noise level and scenario, the same for all policies; bars are Wilson 95 % intervals."
    );
    Some(Product { drawing: Drawing::Figure(Figure { panels, columns }), data, caption })
}

fn panel(rows: &[&NoiseRow], scenario: &str, policies: &[&str]) -> Panel {
    let (mut lines, mut whiskers) = (Vec::new(), Vec::new());
    for (index, policy) in policies.iter().enumerate() {
        let (colour, stroke, mark) = look(policy, index);
        let shift_m = APART_M * (index as f64 - 0.5 * (policies.len() as f64 - 1.0));
        let mut points = Vec::new();
        for row in rows.iter().filter(|row| row.scenario == scenario && row.policy == *policy) {
            let x = row.sigma_m + shift_m;
            points.push((x, 100.0 * row.rate));
            whiskers.push(Whisker { colour, x, low: 100.0 * row.ci95[0], high: 100.0 * row.ci95[1] });
        }
        if !points.is_empty() {
            lines.push(Line { stroke, width: 1, ..Line::solid("", colour, points.clone()) });
            lines.push(Line::marks(*policy, colour, mark, 4, points));
        }
    }
    Panel {
        title: scenario.to_owned(),
        x_label: "standard deviation of the noise (m)".into(),
        y_label: "episodes with contact (%)".into(),
        lines,
        whiskers,
        legend: LegendPlace::Emptiest,
        size_px: Some((560, 460)),
        ..Panel::default()
    }
}

/// The paper's agents as in every figure; others are told apart by their marks.
fn look(policy: &str, index: usize) -> (RGBColor, Stroke, Stroke) {
    let history_len = crate::rl::agent::AgentConfig::default().history_len;
    let agent = AgentKind::ALL
        .into_iter()
        .find(|agent| policy == agent.label() || policy.ends_with(&agent.slug(history_len)));
    match agent {
        Some(agent) => {
            let (colour, stroke) = style(agent);
            (colour, stroke, if agent.estimates { Stroke::Dots } else { Stroke::Squares })
        }
        None => {
            let colour = [colour::GREY, colour::BLACK][index % 2];
            (colour, Stroke::Dashed, [Stroke::Rings, Stroke::Dots, Stroke::Squares][index % 3])
        }
    }
}

fn distinct<'a>(values: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut distinct: Vec<&str> = Vec::new();
    for value in values {
        if !distinct.contains(&value) {
            distinct.push(value);
        }
    }
    distinct
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_policy_noise_level_and_scenario_is_drawn() {
        let mut rows = Vec::new();
        for policy in ["coastal-lstm-sac", "coastal-lstm-sac-baseline", "hold-course"] {
            for scenario in ["before-curve", "straight-on"] {
                for sigma_m in [0.0, 5.0, 10.0, 20.0] {
                    rows.push(format!(
                        "{{\"policy\": \"{policy}\", \"scenario\": \"{scenario}\", \"sigma_m\": {sigma_m}, \"episodes\": 100, \
                         \"collisions\": 7, \"rate\": 0.07, \"ci95\": [0.034, 0.137], \"mean_return\": -1.5, \"more\": 1}}"
                    ));
                }
            }
        }
        let rows: Vec<NoiseRow> = serde_json::from_str(&format!("[{}]", rows.join(","))).unwrap();
        let product = make(&rows).unwrap();
        assert_eq!(product.data.rows().len(), 24);
        assert!(product.caption.contains("100 seeded episodes"), "{}", product.caption);
        let svg = product.to_svg().unwrap();
        for text in ["before-curve", "straight-on", "hold-course", "episodes with contact (%)"] {
            assert!(svg.contains(text), "{text}");
        }
        let (with, without) = (look("coastal-lstm-sac", 0), look("coastal-lstm-sac-baseline", 1));
        assert_ne!((with.1, with.2), (without.1, without.2), "told apart without colours");
        assert!(make(&[]).is_none());
    }
}
