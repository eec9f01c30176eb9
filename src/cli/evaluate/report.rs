//! What an evaluation prints: rows by policy and scenario, and the comparison with the better reference.

use std::io::Write;
use std::path::PathBuf;

use serde::Serialize;

use crate::cli::agent_run::TracksPart;
use crate::cli::table::table;
use crate::env::EnvName;
use crate::env::coastal::Outcome;
use crate::experiment::statistics::{
    BootstrapConfig, CONFIDENCE, Estimate, Interval, mean, proportion, ratio_of_paired_means,
    standard_deviation,
};
use crate::scenario::encounter_starts::HeadOnKind;

/// One episode of one policy.
#[derive(Debug, Clone, Copy)]
pub(super) struct EpisodeResult {
    pub total_reward: f64,
    /// What happened, in the coastal environment.
    pub coastal: Option<Outcome>,
}

impl EpisodeResult {
    /// What a policy is judged by: whether there was contact, or the wrong passings, which are minus the return.
    fn faults(&self) -> f64 {
        self.coastal.map_or(-self.total_reward, |outcome| f64::from(u8::from(outcome.contact)))
    }
}

/// The whole evaluation.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub run: PathBuf,
    pub env: EnvName,
    pub episodes: u64,
    /// Standard deviation of the sensor noise, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracks: Option<TracksPart>,
    pub rows: Vec<Row>,
    /// The agent against the better reference; nothing without references, or where that one is faultless.
    pub comparison: Option<Comparison>,
}

/// One policy over some of the episodes.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    policy: String,
    /// `both`, or one of the coastal scenarios.
    #[serde(skip_serializing_if = "Option::is_none")]
    scenario: Option<&'static str>,
    episodes: u64,
    mean_return: f64,
    return_ci95: Option<[f64; 2]>,
    sd_return: Option<f64>,
    #[serde(flatten)]
    faults: Faults,
}

/// What goes wrong in either environment.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Faults {
    OpenWater {
        wrong_passings_per_episode: f64,
        wrong_passings_ci95: Option<[f64; 2]>,
    },
    Coastal {
        contacts: u64,
        contact_rate: f64,
        contact_ci95: Option<[f64; 2]>,
        /// Contact at the time of a decision, a part of the contacts.
        contact_rate_at_decisions: f64,
        wrong_side: u64,
        wrong_side_rate: f64,
        wrong_side_ci95: Option<[f64; 2]>,
        /// Median over episodes of the closest distance of centres, in metres.
        median_closest_m: f64,
    },
}

fn ends(interval: Option<Interval>) -> Option<[f64; 2]> {
    interval.map(|interval| [interval.low, interval.high])
}

/// The rows of one policy: all episodes, then those of each coastal scenario.
pub(super) fn rows(policy: &str, results: &[EpisodeResult]) -> Vec<Row> {
    let is_coastal = results.iter().all(|result| result.coastal.is_some());
    if !is_coastal {
        return Row::of(policy, None, results).into_iter().collect();
    }
    let of = |kind: HeadOnKind| -> Vec<EpisodeResult> {
        let is_of_kind = |result: &&EpisodeResult| result.coastal.is_some_and(|outcome| outcome.kind == kind);
        results.iter().filter(is_of_kind).copied().collect()
    };
    let parts = [
        ("both", results.to_vec()),
        ("before-curve", of(HeadOnKind::BeforeCurve)),
        ("straight-on", of(HeadOnKind::StraightOn)),
    ];
    parts.iter().filter_map(|(scenario, part)| Row::of(policy, Some(scenario), part)).collect()
}

impl Row {
    /// Nothing without episodes.
    fn of(policy: &str, scenario: Option<&'static str>, results: &[EpisodeResult]) -> Option<Self> {
        let returns: Vec<f64> = results.iter().map(|result| result.total_reward).collect();
        let estimate = mean(&returns, CONFIDENCE)?;
        Some(Self {
            policy: policy.to_owned(),
            scenario,
            episodes: results.len() as u64,
            mean_return: estimate.value,
            return_ci95: ends(estimate.interval),
            sd_return: standard_deviation(&returns),
            faults: Faults::of(results)?,
        })
    }
}

impl Faults {
    fn of(results: &[EpisodeResult]) -> Option<Self> {
        let outcomes: Vec<Outcome> = results.iter().filter_map(|result| result.coastal).collect();
        if outcomes.is_empty() {
            let faults: Vec<f64> = results.iter().map(EpisodeResult::faults).collect();
            let estimate = mean(&faults, CONFIDENCE)?;
            return Some(Self::OpenWater {
                wrong_passings_per_episode: estimate.value,
                wrong_passings_ci95: ends(estimate.interval),
            });
        }
        let share = |holds: fn(&Outcome) -> bool| {
            let count = outcomes.iter().filter(|outcome| holds(outcome)).count() as u64;
            proportion(count, outcomes.len() as u64, CONFIDENCE).map(|share| (count, share))
        };
        let (contacts, contact) = share(|outcome| outcome.contact)?;
        let (_, at_decision) = share(|outcome| outcome.contact_at_decision)?;
        let (wrong_side, wrong) = share(|outcome| outcome.wrong_side)?;
        let mut closest_m: Vec<f64> = outcomes.iter().map(|outcome| outcome.closest_m).collect();
        Some(Self::Coastal {
            contacts,
            contact_rate: contact.value,
            contact_ci95: ends(contact.interval),
            contact_rate_at_decisions: at_decision.value,
            wrong_side,
            wrong_side_rate: wrong.value,
            wrong_side_ci95: ends(wrong.interval),
            median_closest_m: median(&mut closest_m),
        })
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[half - 1] + values[half]) } else { values[half] }
}

/// The agent's faults over those of the better reference, on the same episodes.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Comparison {
    /// The reference with fewer faults.
    reference: String,
    /// What is counted.
    measure: &'static str,
    ratio: f64,
    ratio_ci95: Option<[f64; 2]>,
    /// Whether the intervals of the agent's and of the reference's own faults have no value in common.
    intervals_disjoint: bool,
}

impl Comparison {
    /// `policies` are the agent, then the references.
    pub fn with_better_reference(policies: &[(String, Vec<EpisodeResult>)]) -> Option<Self> {
        let ((_, agent), references) = policies.split_first()?;
        let total = |results: &[EpisodeResult]| results.iter().map(EpisodeResult::faults).sum::<f64>();
        let (name, reference) = references.iter().min_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))?;
        let pairs: Vec<(f64, f64)> =
            agent.iter().zip(reference).map(|(agent, other)| (agent.faults(), other.faults())).collect();
        let ratio = ratio_of_paired_means(&pairs, &BootstrapConfig::default())?;
        let is_coastal = agent.iter().all(|result| result.coastal.is_some());
        let [ours, theirs] = [agent, reference].map(|results| fault_interval(results));
        Some(Self {
            reference: name.clone(),
            measure: if is_coastal { "episodes with contact" } else { "wrong passings" },
            ratio: ratio.value,
            ratio_ci95: ends(ratio.interval),
            intervals_disjoint: ours.zip(theirs).is_some_and(|(ours, theirs)| ours.is_disjoint_from(theirs)),
        })
    }
}

fn fault_interval(results: &[EpisodeResult]) -> Option<Interval> {
    let faults: Vec<f64> = results.iter().map(EpisodeResult::faults).collect();
    let estimate: Option<Estimate> = if results.iter().all(|result| result.coastal.is_some()) {
        proportion(faults.iter().sum::<f64>() as u64, results.len() as u64, CONFIDENCE)
    } else {
        mean(&faults, CONFIDENCE)
    };
    estimate?.interval
}

impl Report {
    /// A table, and the comparison in words.
    pub fn print(&self, out: &mut dyn Write) -> anyhow::Result<()> {
        if let Some(noise_m) = self.noise_m {
            let part = if self.tracks == Some(TracksPart::Training) { "training" } else { "held-out" };
            writeln!(out, "{} episodes on {part} tracks, sensor noise {noise_m} m", self.episodes)?;
        }
        let is_coastal = self.env == EnvName::Coastal;
        let mut rows = if is_coastal {
            let headings =
                ["policy", "scenario", "episodes", "contact", "95 %", "wrong side", "mean return", "closest"];
            table(2, &headings)
        } else {
            table(1, &["policy", "episodes", "wrong passings", "95 %", "mean return", "sd"])
        };
        for row in &self.rows {
            rows.add_row(row.cells());
        }
        writeln!(out, "{rows}")?;
        if let Some(comparison) = &self.comparison {
            writeln!(out, "{}", comparison.sentence())?;
        }
        Ok(())
    }
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let mut cells = vec![self.policy.clone()];
        cells.extend(self.scenario.map(str::to_owned));
        cells.push(self.episodes.to_string());
        match &self.faults {
            Faults::OpenWater { wrong_passings_per_episode, wrong_passings_ci95 } => cells.extend([
                format!("{wrong_passings_per_episode:.2}"),
                range(*wrong_passings_ci95, |end| format!("{end:.2}")),
                format!("{:.2}", self.mean_return),
                self.sd_return.map_or_else(String::new, |sd| format!("{sd:.2}")),
            ]),
            Faults::Coastal { contact_rate, contact_ci95, wrong_side_rate, median_closest_m, .. } => cells
                .extend([
                    percent(*contact_rate),
                    range(*contact_ci95, percent),
                    percent(*wrong_side_rate),
                    format!("{:.2}", self.mean_return),
                    format!("{median_closest_m:.0} m"),
                ]),
        }
        cells
    }
}

impl Comparison {
    fn sentence(&self) -> String {
        let Self { reference, measure, ratio, ratio_ci95, intervals_disjoint } = self;
        let interval = ratio_ci95.map_or_else(String::new, |[low, high]| format!(" ({low:.2} to {high:.2})"));
        let disjoint = if *intervals_disjoint { "do not overlap" } else { "overlap" };
        format!(
            "against {reference}, the better reference: {ratio:.2}{interval} of its {measure}; the intervals of both \
             {disjoint}"
        )
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn range(ends: Option<[f64; 2]>, shown: impl Fn(f64) -> String) -> String {
    ends.map_or_else(String::new, |[low, high]| format!("{} to {}", shown(low), shown(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open_water(wrong_passings: &[u32]) -> Vec<EpisodeResult> {
        let result = |&count: &u32| EpisodeResult { total_reward: -f64::from(count), coastal: None };
        wrong_passings.iter().map(result).collect()
    }

    fn coastal(contacts: &[(HeadOnKind, bool)]) -> Vec<EpisodeResult> {
        let result = |&(kind, contact)| EpisodeResult {
            total_reward: if contact { -3.0 } else { 0.0 },
            coastal: Some(Outcome {
                kind,
                contact,
                contact_at_decision: false,
                wrong_side: !contact,
                closest_m: if contact { 200.0 } else { 600.0 },
            }),
        };
        contacts.iter().map(result).collect()
    }

    fn named(policies: &[(&str, Vec<EpisodeResult>)]) -> Vec<(String, Vec<EpisodeResult>)> {
        policies.iter().map(|(name, results)| ((*name).to_owned(), results.clone())).collect()
    }

    #[test]
    fn wrong_passings_are_minus_the_return() {
        let row = &rows("agent", &open_water(&[2, 0, 4]))[0];
        let json = serde_json::to_value(row).unwrap();
        assert_eq!(
            (json["wrong_passings_per_episode"].as_f64(), json["mean_return"].as_f64()),
            (Some(2.0), Some(-2.0))
        );
        assert_eq!(json["sd_return"], 2.0);
    }

    #[test]
    fn coastal_rows_are_split_by_scenario() {
        use HeadOnKind::{BeforeCurve, StraightOn};
        let results = coastal(&[(BeforeCurve, true), (StraightOn, false), (StraightOn, false)]);
        let rows: Vec<_> =
            rows("agent", &results).iter().map(|row| serde_json::to_value(row).unwrap()).collect();
        let counts = |key: &str| rows.iter().map(|row| row[key].as_u64().unwrap()).collect::<Vec<_>>();
        assert_eq!(counts("episodes"), [3, 1, 2]);
        assert_eq!(counts("contacts"), [1, 1, 0]);
        assert_eq!(counts("wrong_side"), [2, 0, 2]);
        assert_eq!(rows[0]["median_closest_m"], 600.0);
        assert_eq!(rows[2]["scenario"], "straight-on");
        // Wilson (1927): no success in two trials, 0 to 0.6576.
        assert!((rows[2]["contact_ci95"][1].as_f64().unwrap() - 0.6576).abs() < 1e-4);
        assert_eq!(rows[1]["return_ci95"], serde_json::Value::Null, "one episode has no interval");
    }

    #[test]
    fn the_agent_is_compared_with_the_better_reference() {
        let policies = named(&[
            ("agent", open_water(&[1, 2, 1, 2])),
            ("hold-course", open_water(&[9, 9, 9, 9])),
            ("random", open_water(&[6, 5, 7, 6])),
        ]);
        let comparison = Comparison::with_better_reference(&policies).unwrap();
        assert_eq!((comparison.reference.as_str(), comparison.ratio), ("random", 0.25));
        assert!(comparison.intervals_disjoint);
        assert!(comparison.sentence().contains("0.25"), "{}", comparison.sentence());
        assert_eq!(Comparison::with_better_reference(&policies[..1]), None, "no reference");
    }

    #[test]
    fn a_handful_of_episodes_does_not_tell_agents_apart() {
        use HeadOnKind::StraightOn;
        let policies = named(&[
            ("agent", coastal(&[(StraightOn, false), (StraightOn, true)])),
            ("hold-course", coastal(&[(StraightOn, true), (StraightOn, true)])),
        ]);
        let comparison = Comparison::with_better_reference(&policies).unwrap();
        assert_eq!((comparison.ratio, comparison.intervals_disjoint), (0.5, false));
        assert_eq!(comparison.measure, "episodes with contact");
    }
}
