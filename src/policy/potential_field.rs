//! An artificial potential field with predicted passings and the turn that the regulations prescribe.
//!
//! Own ship steers along the sum of an attraction and repulsions (Khatib, Real-time obstacle avoidance for
//! manipulators and mobile robots, *International Journal of Robotics Research* 5 (1986) 90-98), modified for
//! ships that move and for the collision regulations after Lyu and Yin, COLREGS-constrained real-time path
//! planning for autonomous ships using modified artificial potential fields, *Journal of Navigation* 72
//! (2019) 588-608. With `c` the unit vector along the route and `n` the one to starboard of it:
//!
//! - attraction: `c`;
//! - passing, for a target ship that would come within the safe distance `s` on the way along the route, at a
//!   distance `d` and after a time `t` under the horizon `T`: `± k_p sqrt(m) (1 - t/T) n`, where `m` is what is
//!   missing: `1 - d/s` where the target ship would be left to the side that own ship has chosen, `1 + d/s` on the
//!   other. The side is to starboard where any target ship has to be left to port (rules 14, 15) or a turn to port
//!   is forbidden (rule 17c), else away from where the target ship would pass, and is kept until the encounter is
//!   over: the force of a plain field changes its sign with the side of the passing, and turns a ship that overtakes
//!   back into the other's way. The square root keeps the force up until the distance is nearly safe;
//! - nearness, for one that is nearer than `r` now, at a distance `D`: `k_n (r/D - 1)` away from it.
//!
//! A give-way vessel turns so far at least that it is seen to (rule 16).

use serde::{Deserialize, Serialize};

use super::duties::{DutiesConfig, Duty, Watch};
use super::outlook::{Manoeuvre, Outlook};
use super::{Policy, Situation};
use crate::angle::Nautical;
use crate::geo::Displacement;
use crate::vessel::Command;

pub(super) const NAME: &str = "potential-field";

/// Settings of [`PotentialField`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PotentialFieldConfig {
    /// Distance to keep beyond the collision distance, in metres: `s` less that distance.
    pub margin_m: f64,
    /// How far ahead passings count, in seconds: `T`.
    pub horizon_s: f64,
    /// Strength of a passing: `k_p`.
    pub passing_gain: f64,
    /// A nearness counts within the collision distance and this much more, in metres: `r` less that distance.
    pub near_margin_m: f64,
    /// Strength of a nearness: `k_n`.
    pub near_gain: f64,
    /// The largest deviation from the way back to the route, in degrees.
    pub max_deviation_deg: f64,
    /// How far ahead on the route the way back aims, in metres.
    pub lookahead_m: f64,
    /// How it keeps to the collision regulations.
    pub duties: DutiesConfig,
}

impl Default for PotentialFieldConfig {
    /// Found by `searoom tune`; docs/encounters.md tells how.
    fn default() -> Self {
        Self {
            margin_m: 212.0,
            horizon_s: 1510.0,
            passing_gain: 7.03,
            near_margin_m: 21.3,
            near_gain: 0.42,
            max_deviation_deg: 90.0,
            lookahead_m: 2860.0,
            duties: DutiesConfig {
                stand_on_until_s: 440.0,
                clear_factor: 1.46,
                apparent_turn_deg: 18.4,
                ..DutiesConfig::default()
            },
        }
    }
}

/// Steers along the force of the field; keeps its speed.
#[derive(Debug, Clone, Default)]
pub struct PotentialField {
    config: PotentialFieldConfig,
    watch: Watch,
    outlook: Outlook,
    /// Where own ship evades each target ship, as long as the encounter lasts: 1 to starboard, -1 to port.
    sides: Vec<Option<f64>>,
}

impl PotentialField {
    /// With settings of its own.
    #[must_use]
    pub fn new(config: PotentialFieldConfig) -> Self {
        Self { config, ..Self::default() }
    }

    /// Chooses a side for every encounter that has begun and forgets it with those that are over.
    fn choose_sides(&mut self) {
        let duties = self.watch.duties();
        let prescribed = |duty: &Duty| duty.leaves_to_port() || duty.forbids_port_turn();
        // Evading one ship to port and another to starboard would end between them.
        let all_to_starboard = duties.iter().any(|duty| duty.keeps_clear && prescribed(duty));
        self.sides.resize(duties.len(), None);
        for (side, duty) in self.sides.iter_mut().zip(duties) {
            *side = duty.encounter.map(|_| {
                let away = if duty.passing.starboard_m > 0.0 { -1.0 } else { 1.0 };
                if all_to_starboard || prescribed(duty) { 1.0 } else { side.unwrap_or(away) }
            });
        }
    }

    /// Force of a passing that is evaded to a side, positive to starboard.
    fn passing_force(&self, duty: &Duty, side: f64) -> f64 {
        let share = duty.passing.distance_m / duty.safe_m;
        if share >= 1.0 {
            return 0.0;
        }
        // Evaded to starboard, the target ship is left to port.
        let is_on_chosen_side = duty.passing.starboard_m * side <= 0.0;
        let missing = if is_on_chosen_side { 1.0 - share } else { 1.0 + share };
        let urgency = (1.0 - duty.passing.time_s / self.config.horizon_s).max(0.0);
        side * self.config.passing_gain * missing.sqrt() * urgency
    }

    /// Force of a nearness.
    fn near_force(&self, away: Displacement, collision_distance_m: f64) -> Displacement {
        let distance_m = away.length_m();
        let reach_m = collision_distance_m + self.config.near_margin_m;
        // Closer than a metre the field would have no bound.
        let size = self.config.near_gain * (reach_m / distance_m.max(1.0) - 1.0).max(0.0);
        Displacement::towards(away.bearing(), size)
    }

    /// The direction of the force on own ship.
    fn direction(&self, situation: &Situation<'_>, route: Nautical) -> Nautical {
        let starboard = route.turned(std::f64::consts::FRAC_PI_2);
        let mut force = Displacement::towards(route, 1.0);
        let with_duties = situation.targets.iter().zip(self.watch.duties()).zip(&self.sides);
        for ((target, duty), side) in with_duties.filter(|((_, duty), _)| duty.keeps_clear) {
            let away = situation.own.position - target.position;
            let evading = side.map_or(0.0, |side| self.passing_force(duty, side));
            force = force
                + Displacement::towards(starboard, evading)
                + self.near_force(away, target.collision_distance_m);
        }
        force.bearing()
    }
}

impl Policy for PotentialField {
    fn name(&self) -> &str {
        NAME
    }

    fn reset(&mut self, _seed: u64) {
        self.watch.reset();
        self.sides.clear();
    }

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let route = Manoeuvre::along_route(situation, self.config.lookahead_m);
        self.outlook.fill(situation, self.config.horizon_s);
        self.watch.assess(&self.config.duties, situation, &mut self.outlook, route, self.config.margin_m);
        self.choose_sides();
        let limit_rad = self.config.max_deviation_deg.to_radians();
        let turn_rad = self.direction(situation, route.heading).turn_from(route.heading);
        let gives_way = self.watch.duties().iter().any(|duty| duty.keeps_clear && duty.gives_way());
        let least_rad = if gives_way { self.config.duties.apparent_turn_deg.to_radians() } else { 0.0 };
        let size_rad = turn_rad.abs().max(least_rad).min(limit_rad);
        let heading = route.heading.turned(if turn_rad < 0.0 { -size_rad } else { size_rad });
        Manoeuvre { heading, ..route }.command(&situation.own)
    }
}
