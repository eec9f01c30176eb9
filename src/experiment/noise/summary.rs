//! What a cell comes to: rates with intervals, returns, closest distances.

use serde::Serialize;

use super::{Cell, Contestant, Kind, TracksPart, Voyage, Waters, scenario_name};
use crate::experiment::statistics::{CONFIDENCE, Interval, mean, proportion};
use crate::forecast::quantile;
use crate::rl::agent::Algorithm;

/// A share of episodes with its 95 % interval (Wilson).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Share {
    /// Episodes looked at.
    pub episodes: u64,
    /// Those among them that are counted.
    pub count: u64,
    /// The share.
    pub rate: f64,
    /// Its interval, lower end first.
    pub ci95: [f64; 2],
}

impl Share {
    /// Of these voyages; nothing of none.
    fn of<'v>(voyages: impl Iterator<Item = &'v Voyage>, counts: impl Fn(&Voyage) -> bool) -> Option<Self> {
        let (episodes, count) = voyages
            .fold((0, 0), |(episodes, count), voyage| (episodes + 1, count + u64::from(counts(voyage))));
        let estimate = proportion(count, episodes, CONFIDENCE)?;
        Some(Self { episodes, count, rate: estimate.value, ci95: ends(estimate.interval?) })
    }
}

fn ends(interval: Interval) -> [f64; 2] {
    [interval.low, interval.high]
}

/// Quantiles of the closest distance of an episode, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClosestQuantiles {
    /// One episode in a hundred comes closer.
    pub q01: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 25 % quantile.
    pub q25: f64,
    /// Median.
    pub q50: f64,
    /// 75 % quantile.
    pub q75: f64,
}

impl ClosestQuantiles {
    fn of(voyages: &[Voyage]) -> Option<Self> {
        let mut sorted: Vec<f64> = voyages.iter().map(|voyage| voyage.closest_m).collect();
        sorted.sort_by(f64::total_cmp);
        let at = |probability| quantile(&sorted, probability);
        Some(Self { q01: at(0.01)?, q05: at(0.05)?, q25: at(0.25)?, q50: at(0.5)?, q75: at(0.75)? })
    }
}

/// One contestant in one scenario under one noise, as `--json` prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Who steered.
    pub policy: String,
    /// The scenario: `before-curve` or `straight-on`.
    pub scenario: &'static str,
    /// Standard deviation of the sensor noise, in metres.
    pub sigma_m: f64,
    /// Episodes sailed.
    pub episodes: u64,
    /// Those with contact at any time.
    pub collisions: u64,
    /// Their share.
    pub rate: f64,
    /// Wilson's 95 % interval of it.
    pub ci95: [f64; 2],
    /// Mean sum of rewards.
    pub mean_return: f64,
    /// Student's 95 % interval of it; nothing for a single episode.
    pub mean_return_ci95: Option<[f64; 2]>,
    /// Agent or classical policy.
    pub kind: Kind,
    /// How an agent learnt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub algorithm: Option<Algorithm>,
    /// What it was told of the recorded vessel's future: `none`, `forecast` or `truth`.
    pub estimates: &'static str,
    /// Whose tracks: `held-out` or `whole`.
    pub tracks: TracksPart,
    /// Episodes on the wrong side at a decision.
    pub wrong_side: Share,
    /// Episodes with contact at the time of a decision.
    pub contact_at_decision: Share,
    /// Closest distances.
    pub closest_m: ClosestQuantiles,
    /// Mean compliance with the collision regulations, 0 to 1, over the episodes with an encounter.
    pub compliance: Option<f64>,
    /// Estimates that rest on a straight line in place of a forecast.
    pub fallbacks: u64,
    /// Contacts with the vessels among them that training has never seen; nothing where there are none.
    pub unseen_vessels: Option<Share>,
    /// Contacts on as many episodes from the tracks that training has seen; nothing where not sailed.
    pub training_tracks: Option<Share>,
}

/// A row for each cell that is not on training tracks; what was sailed on those stands beside it.
#[must_use]
pub fn rows(cells: &[Cell], contestants: &[Contestant], waters: &[Waters]) -> Vec<Row> {
    let row = |cell: &Cell| {
        let contestant = contestants.iter().find(|contestant| contestant.name == cell.policy)?;
        let waters = waters.iter().find(|waters| waters.part == cell.tracks)?;
        let beside = cells.iter().find(|other| {
            other.tracks == TracksPart::Training
                && (&other.policy, other.scenario, other.sigma_m)
                    == (&cell.policy, cell.scenario, cell.sigma_m)
        });
        Row::of(cell, contestant, waters, beside)
    };
    cells.iter().filter(|cell| cell.tracks != TracksPart::Training).filter_map(row).collect()
}

impl Row {
    /// Nothing for a cell without voyages.
    fn of(cell: &Cell, contestant: &Contestant, waters: &Waters, training: Option<&Cell>) -> Option<Self> {
        let voyages = &cell.voyages;
        let is_contact = |voyage: &Voyage| voyage.contact;
        let contact = Share::of(voyages.iter(), is_contact)?;
        let returns: Vec<f64> = voyages.iter().map(|voyage| voyage.total_reward).collect();
        let mean_return = mean(&returns, CONFIDENCE)?;
        let unseen = || voyages.iter().filter(|voyage| !waters.seen.contains(&voyage.mmsi));
        Some(Self {
            policy: cell.policy.clone(),
            scenario: scenario_name(cell.scenario),
            sigma_m: cell.sigma_m,
            episodes: contact.episodes,
            collisions: contact.count,
            rate: contact.rate,
            ci95: contact.ci95,
            mean_return: mean_return.value,
            mean_return_ci95: mean_return.interval.map(ends),
            kind: contestant.kind,
            algorithm: contestant.algorithm,
            estimates: contestant.estimates.as_str(),
            tracks: cell.tracks,
            wrong_side: Share::of(voyages.iter(), |voyage| voyage.wrong_side)?,
            contact_at_decision: Share::of(voyages.iter(), |voyage| voyage.contact_at_decision)?,
            closest_m: ClosestQuantiles::of(voyages)?,
            compliance: mean_compliance(voyages),
            fallbacks: voyages.iter().map(|voyage| voyage.fallbacks).sum(),
            unseen_vessels: (cell.tracks == TracksPart::HeldOut)
                .then(|| Share::of(unseen(), is_contact))
                .flatten(),
            training_tracks: training.and_then(|cell| Share::of(cell.voyages.iter(), is_contact)),
        })
    }
}

/// Nothing where no episode has an encounter.
fn mean_compliance(voyages: &[Voyage]) -> Option<f64> {
    let scores: Vec<f64> = voyages.iter().filter_map(|voyage| voyage.compliance).collect();
    mean(&scores, CONFIDENCE).map(|estimate| estimate.value)
}
