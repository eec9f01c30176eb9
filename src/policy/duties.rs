//! What the collision regulations ask of own ship towards each target ship, decision by decision.

use serde::{Deserialize, Serialize};

use super::Situation;
use super::outlook::{Manoeuvre, Outlook, Passing};
use crate::encounter::{Encounter, EncounterConfig, EncounterTracker, Risk, Role, Vantage};

/// How a policy keeps to the collision regulations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DutiesConfig {
    /// As a stand-on vessel it keeps its course and speed until the closest point of approach is this
    /// near, in seconds, and then acts for itself (rule 17a ii).
    pub stand_on_until_s: f64,
    /// A duty ends when going back to the route would keep this many times the safe distance; it also ends
    /// when the vessels would draw apart on it from now on.
    pub clear_factor: f64,
    /// As a give-way vessel it alters its course by this much at least, in degrees, so that the other vessel
    /// sees it (rules 8b, 16) ...
    pub apparent_turn_deg: f64,
    /// ... unless it slows down by this fraction at least.
    pub apparent_slowing: f64,
    /// Half-angle of the head-on sector (rule 14), in degrees.
    pub head_on_deg: f64,
    /// Bearing from which on a vessel is abaft the beam, so that it overtakes (rule 13b), in degrees.
    pub abaft_deg: f64,
}

impl Default for DutiesConfig {
    fn default() -> Self {
        let EncounterConfig { head_on_deg, abaft_deg, .. } = EncounterConfig::default();
        Self {
            stand_on_until_s: 480.0,
            clear_factor: 1.2,
            apparent_turn_deg: 20.0,
            apparent_slowing: 0.5,
            head_on_deg,
            abaft_deg,
        }
    }
}

/// How a manoeuvre deviates from the way along the route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deviation {
    /// Radians, positive to starboard.
    pub turn_rad: f64,
    /// What is missing of the planned speed, as a fraction.
    pub slowness: f64,
}

/// Own ship's duty towards one target ship.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Duty {
    /// The encounter, as long as going on along the route risks collision.
    pub encounter: Option<Encounter>,
    /// Whether own ship has to take account of the target ship now.
    pub keeps_clear: bool,
    /// The distance of centres to keep, in metres.
    pub safe_m: f64,
    /// The closest point of approach on the way along the route.
    pub passing: Passing,
}

impl Duty {
    /// Whether the target ship has to be left to port: head-on (rule 14a), or crossing without going
    /// ahead of it (rule 15).
    pub fn leaves_to_port(&self) -> bool {
        matches!(self.encounter, Some(Encounter::HeadOn | Encounter::CrossingFromStarboard))
    }

    /// Whether own ship must not turn to port of its route: for a vessel on its own port side (rule 17c).
    pub fn forbids_port_turn(&self) -> bool {
        self.encounter == Some(Encounter::CrossingFromPort)
    }

    /// Whether own ship has to give way, and so that it is seen to.
    pub fn gives_way(&self) -> bool {
        self.encounter.is_some_and(|encounter| encounter.role() == Role::GiveWay)
    }

    /// Whether a manoeuvre that passes like that breaks a rule.
    pub fn is_broken_by(&self, deviation: Deviation, passing: &Passing, config: &DutiesConfig) -> bool {
        let Deviation { turn_rad, slowness } = deviation;
        let leaves_to_starboard = passing.time_s > 0.0 && passing.starboard_m > 0.0;
        // The spacing of headings may miss the limit by rounding.
        let apparent_rad = config.apparent_turn_deg.to_radians() - 1e-9;
        let is_hidden = turn_rad.abs() < apparent_rad && slowness < config.apparent_slowing;
        (self.leaves_to_port() && leaves_to_starboard)
            || (self.forbids_port_turn() && turn_rad < 0.0)
            || (self.gives_way() && is_hidden)
    }
}

/// Follows the encounters with all target ships.
///
/// Risk of collision is judged on the way along the route, not on the present course: an evasive course is
/// clear by design, and giving it up for that would end in a zigzag.
#[derive(Debug, Clone, Default)]
pub(super) struct Watch {
    trackers: Vec<EncounterTracker>,
    duties: Vec<Duty>,
}

impl Watch {
    /// Forgets everything.
    pub fn reset(&mut self) {
        self.trackers.clear();
    }

    /// One duty per target ship, as last assessed.
    pub fn duties(&self) -> &[Duty] {
        &self.duties
    }

    /// Takes the situation of a decision; own ship would like to go on along the route, and `margin_m` beyond
    /// the collision distance is the distance to keep.
    pub fn assess(
        &mut self,
        config: &DutiesConfig,
        situation: &Situation<'_>,
        outlook: &mut Outlook,
        route: Manoeuvre,
        margin_m: f64,
    ) {
        outlook.run(&situation.own, route);
        self.duties.clear();
        for (index, target) in situation.targets.iter().enumerate() {
            let safe_m = target.collision_distance_m + margin_m;
            if self.trackers.len() == index {
                self.trackers.push(EncounterTracker::new(EncounterConfig {
                    risk_dcpa_m: safe_m,
                    // The outlook ends at the horizon; within it there is risk.
                    risk_tcpa_s: f64::INFINITY,
                    clear_dcpa_factor: config.clear_factor,
                    past_and_clear_s: 0.0,
                    head_on_deg: config.head_on_deg,
                    abaft_deg: config.abaft_deg,
                }));
            }
            let passing = outlook.passing(index, route.heading);
            let own = (situation.own.position, situation.own.velocity);
            let vantage = Vantage::of(own, (target.position, target.velocity));
            // Drawing apart from now on: the closest point is behind, however far.
            let tcpa_s = if passing.time_s > 0.0 { passing.time_s } else { -situation.dt_s };
            let risk = Risk { dcpa_m: passing.distance_m, tcpa_s };
            let tracker = &mut self.trackers[index];
            let encounter = tracker.observe(&vantage, risk);
            let stands_on = tracker.role() == Some(Role::StandOn) && tcpa_s > config.stand_on_until_s;
            self.duties.push(Duty { encounter, keeps_clear: !stands_on, safe_m, passing });
        }
    }
}
