//! Model predictive control over a finite set of heading and speed offsets.
//!
//! Every combination of offsets is simulated against the expected motion of the target ships, and the cheapest
//! one is steered until the next decision: simulation-based control behaviour selection (Johansen, Perez and
//! Cristofaro, Ship collision avoidance and COLREGS compliance using simulation-based control behavior selection
//! with predictive hazard assessment, *IEEE Transactions on Intelligent Transportation Systems* 17 (2016)
//! 3407-3422). With their symbols, the cost of offsets `P` (fraction of the planned speed) and `chi` (deviation
//! from the way back to the route) is
//!
//! `H = sum_i (max_t C_i R_i(t) + kappa mu_i) + k_P (1 - P) + k_chi (chi / 90°)^2 + k_d |chi - chi_last| / 90°`
//!
//! - `R_i(t) = (t_0 / max(t, t_0))^p (s / d_i(t))^q` where target ship `i` is nearer than the safe distance `s`
//!   at time `t` from now, else 0; distances under a quarter of the collision distance count as that;
//! - `C_i = k_coll |v - v_i|^2 / v_planned^2`, with velocities of now: a fast meeting is worse than a slow one;
//! - `mu_i` is 1 where the manoeuvre leaves the target ship to the side that rules 14 and 15 forbid, turns to port
//!   against rule 17c, or is too small to be seen where own ship gives way (rule 16); a deviation to port costs `k_port` times more.
//!
//! Theirs takes the largest hazard over target ships instead of the sum; with the sum a manoeuvre that is bad
//! for two of them is worse than one that is bad for one.

use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use super::duties::{Deviation, DutiesConfig, Watch};
use super::outlook::{Manoeuvre, Outlook, deviations};
use super::{OwnShip, Policy, Situation, TargetShip};
use crate::vessel::Command;

pub(super) const NAME: &str = "mpc";

/// Settings of [`PredictiveControl`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PredictiveConfig {
    /// Distance to keep beyond the collision distance, in metres: `s` less that distance.
    pub margin_m: f64,
    /// How far ahead manoeuvres are simulated, in seconds.
    pub horizon_s: f64,
    /// The largest deviation from the way back to the route, in degrees.
    pub max_deviation_deg: f64,
    /// Spacing of the headings that are tried, in degrees.
    pub heading_step_deg: f64,
    /// Speeds that are tried where own ship may change its speed: values of `P`.
    pub speed_fractions: Vec<f64>,
    /// Weight of the hazard: `k_coll`.
    pub collision_cost: f64,
    /// Hazards sooner than this are all equally near, in seconds: `t_0`.
    pub near_time_s: f64,
    /// How fast a hazard loses weight with time: `p`.
    pub time_exponent: f64,
    /// How fast a hazard gains weight with nearness: `q`.
    pub distance_exponent: i32,
    /// Cost of breaking a rule: `kappa`.
    pub rule_cost: f64,
    /// Cost of standing still: `k_P`.
    pub speed_cost: f64,
    /// Cost of a deviation of 90 degrees: `k_chi`.
    pub heading_cost: f64,
    /// What a deviation to port costs more than one to starboard, as a fraction of it: `k_port`.
    pub port_cost: f64,
    /// Cost of changing the deviation by 90 degrees: `k_d`.
    pub change_cost: f64,
    /// How far ahead on the route the way back aims, in metres.
    pub lookahead_m: f64,
    /// How it keeps to the collision regulations.
    pub duties: DutiesConfig,
}

impl Default for PredictiveConfig {
    /// Found by `searoom tune`; docs/encounters.md tells how.
    fn default() -> Self {
        Self {
            margin_m: 287.0,
            horizon_s: 1340.0,
            max_deviation_deg: 90.0,
            heading_step_deg: 5.0,
            speed_fractions: vec![1.0, 0.5, 0.0],
            collision_cost: 86.2,
            near_time_s: 290.0,
            time_exponent: 0.339,
            distance_exponent: 4,
            rule_cost: 3.11,
            speed_cost: 1.35,
            heading_cost: 1.0,
            port_cost: 1.1,
            // The search found 0.55, with which the last few degrees back to the route are not worth it.
            change_cost: 0.02,
            lookahead_m: 1230.0,
            duties: DutiesConfig {
                stand_on_until_s: 407.0,
                clear_factor: 1.05,
                apparent_turn_deg: 12.9,
                ..DutiesConfig::default()
            },
        }
    }
}

/// Steers the cheapest of the manoeuvres that it simulates.
#[derive(Debug, Clone, Default)]
pub struct PredictiveControl {
    config: PredictiveConfig,
    watch: Watch,
    outlook: Outlook,
    /// The deviation of the last decision, in radians.
    last_turn_rad: f64,
}

/// A manoeuvre that is tried.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    manoeuvre: Manoeuvre,
    deviation: Deviation,
    /// Its cost without the target ships.
    own_cost: f64,
}

impl PredictiveControl {
    /// With settings of its own.
    #[must_use]
    pub fn new(config: PredictiveConfig) -> Self {
        Self { config, ..Self::default() }
    }

    /// What a deviation costs whatever the target ships do.
    fn own_cost(&self, deviation: Deviation) -> f64 {
        let config = &self.config;
        let Deviation { turn_rad, slowness } = deviation;
        let turn = turn_rad / FRAC_PI_2;
        let to_port = if turn_rad < 0.0 { 1.0 + config.port_cost } else { 1.0 };
        config.speed_cost * slowness
            + config.heading_cost * to_port * turn * turn
            + config.change_cost * (turn_rad - self.last_turn_rad).abs() / FRAC_PI_2
    }

    /// Every manoeuvre that is tried, the cheapest first as far as the target ships are left aside.
    fn candidates(&self, own: &OwnShip<'_>, route: Manoeuvre) -> Vec<Candidate> {
        let speeds = own.speeds(&self.config.speed_fractions);
        let mut candidates: Vec<_> = deviations(self.config.max_deviation_deg, self.config.heading_step_deg)
            .flat_map(|turn_rad| speeds.iter().map(move |&speed_mps| (turn_rad, speed_mps)))
            .map(|(turn_rad, speed_mps)| {
                let deviation = Deviation { turn_rad, slowness: own.slowness(speed_mps) };
                let manoeuvre = Manoeuvre { heading: route.heading.turned(turn_rad), speed_mps };
                Candidate { manoeuvre, deviation, own_cost: self.own_cost(deviation) }
            })
            .collect();
        candidates.sort_by(|a, b| a.own_cost.total_cmp(&b.own_cost));
        candidates
    }

    /// `H` of a manoeuvre; where it is `most` or more, something that is as well.
    fn cost(&mut self, situation: &Situation<'_>, candidate: Candidate, most: f64) -> f64 {
        let Candidate { manoeuvre, deviation, own_cost: mut cost } = candidate;
        self.outlook.run(&situation.own, manoeuvre);
        let config = &self.config;
        for (index, duty) in self.watch.duties().iter().enumerate().filter(|(_, duty)| duty.keeps_clear) {
            if cost >= most {
                break;
            }
            let target = &situation.targets[index];
            let passing = self.outlook.passing(index, manoeuvre.heading);
            if passing.distance_m < duty.safe_m {
                cost += self.severity(&situation.own, target) * self.hazard(index, target, duty.safe_m);
            }
            if duty.is_broken_by(deviation, &passing, &config.duties) {
                cost += config.rule_cost;
            }
        }
        cost
    }

    /// `C_i`.
    fn severity(&self, own: &OwnShip<'_>, target: &TargetShip<'_>) -> f64 {
        let relative = (own.velocity - target.velocity).speed_mps() / own.planned_speed_mps.max(1.0);
        self.config.collision_cost * relative * relative
    }

    /// The largest `R_i(t)` of the manoeuvre that was simulated last.
    fn hazard(&self, index: usize, target: &TargetShip<'_>, safe_m: f64) -> f64 {
        let config = &self.config;
        let floor_m = 0.25 * target.collision_distance_m;
        let (own, path) = (self.outlook.own(), self.outlook.target(index));
        let mut worst = 0.0_f64;
        let mut step = 0;
        while step < own.len() {
            let distance_m = own[step].distance_m(path[step]);
            if distance_m < safe_m {
                let time_s = self.outlook.time_s(step).max(config.near_time_s);
                let nearness = (safe_m / distance_m.max(floor_m)).powi(config.distance_exponent);
                worst = worst.max((config.near_time_s / time_s).powf(config.time_exponent) * nearness);
            }
            step += self.outlook.steps_apart(index, distance_m, safe_m).max(1);
        }
        worst
    }
}

impl Policy for PredictiveControl {
    fn name(&self) -> &str {
        NAME
    }

    fn reset(&mut self, _seed: u64) {
        self.watch.reset();
        self.last_turn_rad = 0.0;
    }

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let own = &situation.own;
        let route = Manoeuvre::along_route(situation, self.config.lookahead_m);
        self.outlook.fill(situation, self.config.horizon_s);
        self.watch.assess(&self.config.duties, situation, &mut self.outlook, route, self.config.margin_m);
        let mut best = (f64::INFINITY, route, 0.0);
        for candidate in self.candidates(own, route) {
            if candidate.own_cost >= best.0 {
                break;
            }
            let cost = self.cost(situation, candidate, best.0);
            if cost < best.0 {
                best = (cost, candidate.manoeuvre, candidate.deviation.turn_rad);
            }
        }
        self.last_turn_rad = best.2;
        best.1.command(own)
    }
}
