//! Everything that happened in one encounter: what a scenario run records and a report shows.
//!
//! Step `k` is the time `k dt_s` after the start; step 0 is the start itself. Vessels keep their
//! index throughout; own ship is vessel 0 and the target ships follow, so that pair `i` of a step is
//! own ship with vessel `i + 1`.

use serde::{Deserialize, Serialize};

use crate::angle::Nautical;
use crate::cpa::{Cpa, linear};
use crate::encounter::{
    self, ComplianceConfig, Encounter, EncounterConfig, EncounterReport, PairMoment, Vantage, classify,
};
use crate::geo::{Geodetic, Position, Velocity};
use crate::world::{self, PairReport, VesselBody};

/// One encounter from start to end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Name of the scenario.
    pub scenario: String,
    /// What the scenario is about, in a sentence; may be empty.
    pub description: String,
    /// Seed of all that was drawn.
    pub seed: u64,
    /// Name of the policy that commanded own ship.
    pub policy: String,
    /// Time between two steps, in seconds.
    pub dt_s: f64,
    /// Where the local plane touches the earth; nothing for an encounter that is nowhere.
    pub origin: Option<Geodetic>,
    /// Own ship first, then the target ships.
    pub vessels: Vec<VesselInfo>,
    /// The start and every step after it.
    pub steps: Vec<Step>,
}

/// What does not change about a vessel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VesselInfo {
    /// Its name, as the scenario gives it.
    pub name: String,
    /// Own ship or target ship.
    pub role: VesselRole,
    /// How it moves, in a word or two: `recorded`, `linear`, `kinematic`.
    pub motion: String,
    /// Length over all, in metres.
    pub length_m: f64,
    /// Greatest beam, in metres.
    pub beam_m: f64,
    /// Corners of the hull, in metres ahead and to starboard of the reference point.
    pub hull: Vec<HullPoint>,
    /// Radius of its collision circle, in metres.
    pub collision_radius_m: f64,
}

impl VesselInfo {
    /// A vessel with this body; `motion` says in a word or two how it moves.
    #[must_use]
    pub fn new(name: &str, role: VesselRole, motion: &str, body: &VesselBody) -> Self {
        let corner = |point: &world::HullPoint| HullPoint {
            forward_m: point.forward_m,
            starboard_m: point.starboard_m,
        };
        Self {
            name: name.to_owned(),
            role,
            motion: motion.to_owned(),
            length_m: body.hull.length_m(),
            beam_m: body.hull.beam_m(),
            hull: body.hull.points().iter().map(corner).collect(),
            collision_radius_m: body.collision_radius_m,
        }
    }
}

/// Which side of the encounter a vessel is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VesselRole {
    /// The vessel that the policy commands.
    Own,
    /// Any other.
    Target,
}

impl VesselRole {
    /// As files write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Target => "target",
        }
    }
}

/// A corner of a hull in the axes of its vessel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HullPoint {
    /// Metres ahead of the reference point.
    pub forward_m: f64,
    /// Metres to starboard of the reference point.
    pub starboard_m: f64,
}

/// The state of the encounter at one time, and what happened since the time before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// One per vessel.
    pub vessels: Vec<VesselStep>,
    /// One per target ship.
    pub pairs: Vec<PairStep>,
}

/// One vessel at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VesselStep {
    /// Where its reference point truly is.
    pub position: Position,
    /// Its velocity over ground.
    pub velocity: Velocity,
    /// Where its bow points.
    pub heading: Nautical,
    /// Where sensors place it; nothing where sensors are free of noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observed: Option<Position>,
    /// Where it is forecast or planned to go, nearest first; empty where nothing is forecast.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ahead: Vec<Position>,
}

/// Own ship and one target ship over the step that ends at one time. At step 0, which no time
/// leads up to, the closest values are the present ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PairStep {
    /// Distance of the reference points now, in metres.
    pub centre_distance_m: f64,
    /// Distance of the hulls now, in metres; 0 where they overlap.
    pub hull_distance_m: f64,
    /// The smallest distance of the reference points within the step, in metres.
    pub closest_centre_m: f64,
    /// When it was reached, in seconds after the start of the episode.
    pub closest_centre_time_s: f64,
    /// The smallest distance of the hulls within the step, in metres.
    pub closest_hull_m: f64,
    /// When the collision circles first touched within the step, in seconds after the start of the
    /// episode; nothing where they stayed apart.
    pub circle_contact_time_s: Option<f64>,
    /// As `circle_contact_time_s`, for the hulls.
    pub hull_contact_time_s: Option<f64>,
}

impl From<&PairReport> for PairStep {
    /// Of a pair whose first vessel is own ship.
    fn from(report: &PairReport) -> Self {
        Self {
            centre_distance_m: report.centre_distance_m,
            hull_distance_m: report.hull_distance_m,
            closest_centre_m: report.min_centre_distance_m,
            closest_centre_time_s: report.min_centre_time_s,
            closest_hull_m: report.min_hull_distance_m,
            circle_contact_time_s: report.circle_contact_time_s,
            hull_contact_time_s: report.hull_contact_time_s,
        }
    }
}

/// What came of the encounter with one target ship.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TargetSummary {
    /// Index of the target ship among the vessels.
    pub vessel: usize,
    /// Its name.
    pub name: String,
    /// The encounter at the start, as the collision regulations see it; nothing where no rule
    /// applies.
    pub encounter: Option<Encounter>,
    /// Distance of the reference points at the start, in metres.
    pub start_distance_m: f64,
    /// CPA at the start if both vessels kept their velocities.
    pub start_cpa: Cpa,
    /// The smallest distance of the reference points, in metres.
    pub closest_centre_m: f64,
    /// When it was reached, in seconds after the start.
    pub closest_centre_time_s: f64,
    /// The smallest distance of the hulls, in metres.
    pub closest_hull_m: f64,
    /// The distance of reference points at which the collision circles touch, in metres.
    pub contact_distance_m: f64,
    /// When the collision circles first touched, in seconds after the start.
    pub first_circle_contact_s: Option<f64>,
    /// When the hulls first touched, in seconds after the start.
    pub first_hull_contact_s: Option<f64>,
    /// How often the circles came into touch: runs of steps with contact.
    pub circle_contacts: usize,
}

/// How well own ship kept to the collision regulations in an episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compliance {
    /// Its encounters, by target ship and then by time.
    pub encounters: Vec<TargetEncounter>,
    /// The mean score of the encounters, 0 to 1; nothing where there was none.
    pub score: Option<f64>,
}

/// An encounter with a target ship.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TargetEncounter {
    /// Name of the target ship.
    pub target: String,
    /// What it was and how own ship did.
    #[serde(flatten)]
    pub report: EncounterReport,
}

impl Episode {
    /// Time of the last step, in seconds after the start.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.time_s(self.steps.len().saturating_sub(1))
    }

    /// Time of a step, in seconds after the start.
    #[must_use]
    pub fn time_s(&self, step: usize) -> f64 {
        self.dt_s * step as f64
    }

    /// The distance of reference points at which the collision circles of own ship and a vessel
    /// touch, in metres.
    #[must_use]
    pub fn contact_distance_m(&self, vessel: usize) -> f64 {
        self.vessels[0].collision_radius_m + self.vessels[vessel].collision_radius_m
    }

    /// Whether any collision circle touched own ship's.
    #[must_use]
    pub fn has_contact(&self) -> bool {
        self.steps.iter().flat_map(|step| &step.pairs).any(|pair| pair.circle_contact_time_s.is_some())
    }

    /// What came of each target ship, in the order of the vessels; nothing for an episode without
    /// steps.
    #[must_use]
    pub fn summaries(&self) -> Vec<TargetSummary> {
        if self.steps.is_empty() {
            return Vec::new();
        }
        (1..self.vessels.len()).map(|vessel| self.summary(vessel)).collect()
    }

    /// Own ship's encounters under the collision regulations and how well it kept to them; the `Default`s of
    /// both configurations are documented ones.
    #[must_use]
    pub fn compliance(&self, encounters: &EncounterConfig, config: &ComplianceConfig) -> Compliance {
        let of_vessel = |vessel: usize| {
            let seen = |state: &VesselStep| (state.position, state.velocity);
            let moments: Vec<_> = self
                .steps
                .iter()
                .map(|step| PairMoment { own: seen(&step.vessels[0]), target: seen(&step.vessels[vessel]) })
                .collect();
            encounter::assess(&moments, self.dt_s, self.contact_distance_m(vessel), encounters, config)
                .into_iter()
                .map(move |report| TargetEncounter { target: self.vessels[vessel].name.clone(), report })
        };
        let encounters: Vec<_> = (1..self.vessels.len()).flat_map(of_vessel).collect();
        let sum: f64 = encounters.iter().map(|encounter| encounter.report.score).sum();
        let score = (!encounters.is_empty()).then(|| sum / encounters.len() as f64);
        Compliance { encounters, score }
    }

    fn summary(&self, vessel: usize) -> TargetSummary {
        let pairs = || self.steps.iter().map(|step| &step.pairs[vessel - 1]);
        let (own, target) = (&self.steps[0].vessels[0], &self.steps[0].vessels[vessel]);
        let first = &self.steps[0].pairs[vessel - 1];
        let closest =
            pairs().fold(
                first,
                |best, pair| {
                    if pair.closest_centre_m < best.closest_centre_m { pair } else { best }
                },
            );
        let vantage = Vantage::of((own.position, own.velocity), (target.position, target.velocity));
        TargetSummary {
            vessel,
            name: self.vessels[vessel].name.clone(),
            encounter: classify(&vantage, &EncounterConfig::default()),
            start_distance_m: first.centre_distance_m,
            start_cpa: linear::closest_approach(
                own.position.xy(),
                own.velocity.xy(),
                target.position.xy(),
                target.velocity.xy(),
            ),
            closest_centre_m: closest.closest_centre_m,
            closest_centre_time_s: closest.closest_centre_time_s,
            closest_hull_m: pairs().map(|pair| pair.closest_hull_m).fold(f64::INFINITY, f64::min),
            contact_distance_m: self.contact_distance_m(vessel),
            first_circle_contact_s: pairs().find_map(|pair| pair.circle_contact_time_s),
            first_hull_contact_s: pairs().find_map(|pair| pair.hull_contact_time_s),
            circle_contacts: runs(pairs().map(|pair| pair.circle_contact_time_s.is_some())),
        }
    }
}

/// Runs of `true`.
fn runs(flags: impl Iterator<Item = bool>) -> usize {
    let mut before = false;
    flags.filter(|&now| !std::mem::replace(&mut before, now) && now).count()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Own ship goes north and a target ship south, `side_m` to the east, for 60 steps of 5 s; the
    /// closest approach lies between two steps.
    pub(crate) fn head_on(side_m: f64) -> Episode {
        let speed_mps = 8.0;
        let dt_s = 5.0;
        let vessel = |name: &str, role| VesselInfo {
            name: name.to_owned(),
            role,
            motion: "linear".to_owned(),
            length_m: 120.0,
            beam_m: 20.0,
            hull: [(60.0, 0.0), (35.0, 10.0), (-60.0, 10.0), (-60.0, -10.0), (35.0, -10.0)]
                .map(|(forward_m, starboard_m)| HullPoint { forward_m, starboard_m })
                .to_vec(),
            collision_radius_m: 150.0,
        };
        let start_m = 2420.0;
        let meeting_s = start_m / (2.0 * speed_mps);
        let steps = (0..=60).map(|k| {
            let time_s = f64::from(k) * dt_s;
            let along_m = start_m - 2.0 * speed_mps * time_s;
            let closest_s = meeting_s.clamp((time_s - dt_s).max(0.0), time_s);
            let closest_m = side_m.hypot(start_m - 2.0 * speed_mps * closest_s);
            let own = VesselStep {
                position: Position { north_m: speed_mps * time_s, east_m: 0.0 },
                velocity: Velocity { north_mps: speed_mps, east_mps: 0.0 },
                heading: Nautical::NORTH,
                observed: None,
                ahead: Vec::new(),
            };
            let target = VesselStep {
                position: Position { north_m: start_m - speed_mps * time_s, east_m: side_m },
                velocity: Velocity { north_mps: -speed_mps, east_mps: 0.0 },
                heading: Nautical::NORTH.reciprocal(),
                observed: Some(Position {
                    north_m: start_m - speed_mps * time_s + 3.0,
                    east_m: side_m - 4.0,
                }),
                ahead: Vec::new(),
            };
            let pair = PairStep {
                centre_distance_m: side_m.hypot(along_m),
                hull_distance_m: (side_m.hypot(along_m) - 120.0).max(0.0),
                closest_centre_m: closest_m,
                closest_centre_time_s: closest_s,
                closest_hull_m: (closest_m - 120.0).max(0.0),
                circle_contact_time_s: (closest_m < 300.0).then_some(closest_s),
                hull_contact_time_s: None,
            };
            Step { vessels: vec![own, target], pairs: vec![pair] }
        });
        Episode {
            scenario: "head_on".to_owned(),
            description: "Two vessels meet.".to_owned(),
            seed: 7,
            policy: "hold-course".to_owned(),
            dt_s,
            origin: None,
            vessels: vec![vessel("own ship", VesselRole::Own), vessel("target 1", VesselRole::Target)],
            steps: steps.collect(),
        }
    }

    #[test]
    fn the_summary_finds_the_closest_approach_between_two_steps() {
        let episode = head_on(40.0);
        let [summary] = &episode.summaries()[..] else { panic!("one target ship") };
        assert_eq!(summary.closest_centre_m, 40.0);
        assert!((summary.closest_centre_time_s - 151.25).abs() < 1e-9);
        assert!((summary.start_cpa.distance_m - 40.0).abs() < 1e-9);
        assert!((summary.start_cpa.time_s - 151.25).abs() < 1e-9);
        assert_eq!(summary.encounter, Some(Encounter::HeadOn));
        assert_eq!(summary.contact_distance_m, 300.0);
        assert_eq!(summary.circle_contacts, 1);
        assert!(episode.has_contact());
        assert_eq!(episode.duration_s(), 300.0);
    }

    #[test]
    fn a_clear_passing_has_no_contact() {
        let episode = head_on(400.0);
        let summary = &episode.summaries()[0];
        assert_eq!((summary.first_circle_contact_s, summary.circle_contacts), (None, 0));
        assert!(!episode.has_contact());
    }

    #[test]
    fn an_episode_without_steps_has_no_summaries() {
        let episode = Episode { steps: Vec::new(), ..head_on(40.0) };
        assert!(episode.summaries().is_empty() && episode.duration_s() == 0.0);
    }

    #[test]
    fn contacts_are_counted_by_their_beginnings() {
        let flags = [false, true, true, false, true].into_iter();
        assert_eq!(runs(flags), 2);
        assert_eq!(runs([true].into_iter()), 1);
    }

    #[test]
    fn an_episode_survives_json() {
        let episode = head_on(40.0);
        let text = serde_json::to_string(&episode).unwrap();
        assert_eq!(serde_json::from_str::<Episode>(&text).unwrap(), episode);
    }
}
