//! Velocity obstacles with the side that the collision regulations prescribe.
//!
//! A velocity obstacle is the set of own velocities that meet a target ship within a horizon (Fiorini and
//! Shiller, Motion planning in dynamic environments using velocity obstacles, *International Journal of
//! Robotics Research* 17 (1998) 760-772). Two refinements make it fit ships:
//!
//! - Own ship takes time to turn. A velocity stands for the manoeuvre that leads to it, and it is the
//!   manoeuvre that must not meet the target ship (generalised velocity obstacles: Wilkie, van den Berg and
//!   Manocha, IROS 2009, 5573-5578). With a forecast the target ship moves on a path instead of a straight line
//!   (non-linear velocity obstacles: Large, Laugier and Shiller, *Autonomous Robots* 19 (2005) 159-171).
//! - Of the velocities outside, those that leave a target ship to starboard are forbidden where rules 14 and
//!   15 ask to leave it to port (Kuwata, Wolf, Zarzhitsky and Huntsberger, Safe maritime autonomous navigation
//!   with COLREGS, using velocity obstacles, *IEEE Journal of Oceanic Engineering* 39 (2014) 110-119).

use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use super::duties::{Deviation, DutiesConfig, Watch};
use super::outlook::{Manoeuvre, Outlook, deviations};
use super::{OwnShip, Policy, Situation};
use crate::vessel::Command;

pub(super) const NAME: &str = "velocity-obstacle";

/// Settings of [`VelocityObstacle`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VelocityObstacleConfig {
    /// Distance to keep beyond the collision distance, in metres.
    pub margin_m: f64,
    /// How far ahead velocities are judged, in seconds.
    pub horizon_s: f64,
    /// The largest deviation from the way back to the route, in degrees.
    pub max_deviation_deg: f64,
    /// Spacing of the headings that are tried, in degrees.
    pub heading_step_deg: f64,
    /// Speeds that are tried where own ship may change its speed, as fractions of the planned one.
    pub speed_fractions: Vec<f64>,
    /// What a speed of zero costs beside a deviation of 90 degrees, which costs 1.
    pub speed_cost: f64,
    /// What a deviation to port costs more than one to starboard, as a fraction of it.
    pub port_cost: f64,
    /// How far ahead on the route the way back aims, in metres.
    pub lookahead_m: f64,
    /// How it keeps to the collision regulations.
    pub duties: DutiesConfig,
}

impl Default for VelocityObstacleConfig {
    /// Found by `searoom tune`; docs/encounters.md tells how.
    fn default() -> Self {
        Self {
            // The search found 295 m, which a coastal encounter has no room for.
            margin_m: 150.0,
            horizon_s: 912.0,
            max_deviation_deg: 90.0,
            heading_step_deg: 2.0,
            speed_fractions: vec![1.0, 0.75, 0.5, 0.25],
            speed_cost: 0.869,
            port_cost: 0.202,
            lookahead_m: 2580.0,
            duties: DutiesConfig {
                stand_on_until_s: 549.0,
                clear_factor: 1.28,
                apparent_turn_deg: 38.4,
                ..DutiesConfig::default()
            },
        }
    }
}

/// Steers the velocity nearest to the wanted one that no target ship's obstacle holds and no rule forbids.
#[derive(Debug, Clone, Default)]
pub struct VelocityObstacle {
    config: VelocityObstacleConfig,
    watch: Watch,
    outlook: Outlook,
}

/// What speaks against a manoeuvre; the first value that differs decides.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
struct Badness {
    /// How much of the safe distance is missing at worst, 0 to 1.
    shortfall: f64,
    /// Target ships that are left to the forbidden side, or a forbidden turn.
    violations: usize,
}

impl Badness {
    const NONE: Self = Self { shortfall: 0.0, violations: 0 };
}

/// A manoeuvre and what speaks for it.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    manoeuvre: Manoeuvre,
    deviation: Deviation,
    cost: f64,
}

impl VelocityObstacle {
    /// With settings of its own.
    #[must_use]
    pub fn new(config: VelocityObstacleConfig) -> Self {
        Self { config, ..Self::default() }
    }

    /// Every heading and speed that may be tried, the cheapest first.
    fn candidates(&self, own: &OwnShip<'_>, route: Manoeuvre) -> Vec<Candidate> {
        let config = &self.config;
        let speeds = own.speeds(&config.speed_fractions);
        let mut candidates: Vec<_> = deviations(config.max_deviation_deg, config.heading_step_deg)
            .flat_map(|turn_rad| speeds.iter().map(move |&speed_mps| (turn_rad, speed_mps)))
            .map(|(turn_rad, speed_mps)| {
                let turn = turn_rad.abs() / FRAC_PI_2;
                let to_port = if turn_rad < 0.0 { config.port_cost * turn } else { 0.0 };
                let slowness = own.slowness(speed_mps);
                Candidate {
                    manoeuvre: Manoeuvre { heading: route.heading.turned(turn_rad), speed_mps },
                    deviation: Deviation { turn_rad, slowness },
                    cost: turn + to_port + config.speed_cost * slowness,
                }
            })
            .collect();
        candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        candidates
    }

    /// What the obstacles and the rules say of a manoeuvre; where it misses more than `most` of the safe distance,
    /// something that does as well.
    fn judge(&mut self, own: &OwnShip<'_>, candidate: Candidate, most: f64) -> Badness {
        let Candidate { manoeuvre, deviation, .. } = candidate;
        self.outlook.run(own, manoeuvre);
        let mut badness = Badness { shortfall: 0.0, violations: 0 };
        for (index, duty) in self.watch.duties().iter().enumerate().filter(|(_, duty)| duty.keeps_clear) {
            let passing = self.outlook.passing(index, manoeuvre.heading);
            badness.shortfall = badness.shortfall.max(1.0 - passing.distance_m / duty.safe_m);
            if badness.shortfall > most {
                break;
            }
            badness.violations += usize::from(duty.is_broken_by(deviation, &passing, &self.config.duties));
        }
        badness
    }
}

impl Policy for VelocityObstacle {
    fn name(&self) -> &str {
        NAME
    }

    fn reset(&mut self, _seed: u64) {
        self.watch.reset();
    }

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let own = &situation.own;
        let route = Manoeuvre::along_route(situation, self.config.lookahead_m);
        self.outlook.fill(situation, self.config.horizon_s);
        self.watch.assess(&self.config.duties, situation, &mut self.outlook, route, self.config.margin_m);
        let mut best: Option<(Badness, Manoeuvre)> = None;
        for candidate in self.candidates(own, route) {
            let most = best.map_or(f64::INFINITY, |(least, _)| least.shortfall);
            let badness = self.judge(own, candidate, most);
            if best.is_none_or(|(least, _)| badness < least) {
                best = Some((badness, candidate.manoeuvre));
            }
            if badness == Badness::NONE {
                break;
            }
        }
        best.map_or_else(Command::default, |(_, manoeuvre)| manoeuvre.command(own))
    }
}
