//! What a policy expects of the coming minutes: own ship on a manoeuvre, the target ships on their
//! forecasts, all on one grid of times from now on.

use super::{OwnShip, Situation};
use crate::angle::Nautical;
use crate::geo::{Displacement, Position, Velocity};
use crate::vessel::Command;
use crate::world::Approach;

/// Deviations to either side that are tried at most, however fine their spacing.
const MAX_DEVIATIONS: f64 = 720.0;

/// What own ship may do: turn to a heading and change to a speed, each as fast as its commands allow, and
/// then hold both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Manoeuvre {
    pub heading: Nautical,
    pub speed_mps: f64,
}

/// The closest point of approach of a manoeuvre with a target ship, over the horizon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passing {
    /// Distance, in metres.
    pub distance_m: f64,
    /// Time from now, in seconds; 0 where the two draw apart from now on.
    pub time_s: f64,
    /// How far to starboard of the manoeuvre's heading the target ship is then, in metres.
    pub starboard_m: f64,
}

/// Expected positions, `step_s` apart, the present ones first. The buffers are kept from decision to
/// decision.
#[derive(Debug, Clone, Default)]
pub(super) struct Outlook {
    step_s: f64,
    steps: usize,
    steps_per_decision: usize,
    targets: Vec<Vec<Position>>,
    /// The longest step of each target ship, in metres.
    target_step_m: Vec<f64>,
    own: Vec<Position>,
    /// The longest step of own ship, in metres.
    own_step_m: f64,
}

/// Every so many steps the distance is looked at first, for a bound on the closest one.
const COARSE_STEPS: usize = 12;
/// What rounding may add to a step, as a fraction.
const ROUNDING: f64 = 1e-9;

impl Outlook {
    /// Looks `horizon_s` ahead, in the time steps of the situation.
    pub fn fill(&mut self, situation: &Situation<'_>, horizon_s: f64) {
        self.step_s = situation.dt_s;
        self.steps = (horizon_s / self.step_s).ceil().max(1.0) as usize;
        self.steps_per_decision = (situation.decision_s / self.step_s).round().max(1.0) as usize;
        self.targets.resize_with(situation.targets.len(), Vec::new);
        for (path, target) in self.targets.iter_mut().zip(situation.targets) {
            path.clear();
            path.extend((0..=self.steps).map(|step| target.expected(step as f64 * self.step_s, self.step_s)));
        }
        self.target_step_m.clear();
        self.target_step_m.extend(
            self.targets
                .iter()
                .map(|path| path.windows(2).map(|step| step[0].distance_m(step[1])).fold(0.0, f64::max)),
        );
    }

    /// Runs own ship through a manoeuvre.
    pub fn run(&mut self, own: &OwnShip<'_>, manoeuvre: Manoeuvre) {
        let mut position = own.position;
        let mut way = Displacement::default();
        self.own.clear();
        self.own.push(position);
        self.own_step_m = 0.0;
        let mut ordered = Manoeuvre { heading: own.ordered_heading, speed_mps: own.velocity.speed_mps() };
        for step in 0..self.steps {
            if step % self.steps_per_decision == 0 && (step == 0 || ordered != manoeuvre) {
                ordered = manoeuvre.within_reach(ordered, own);
                way = Velocity::from_course(ordered.heading, ordered.speed_mps).for_seconds(self.step_s);
                self.own_step_m = self.own_step_m.max(way.length_m());
            }
            position += way;
            self.own.push(position);
        }
    }

    /// Own ship's positions on the last manoeuvre that was run.
    pub fn own(&self) -> &[Position] {
        &self.own
    }

    /// Whole steps from one at which the two are `distance_m` apart until they may be within `reach_m`.
    pub fn steps_apart(&self, index: usize, distance_m: f64, reach_m: f64) -> usize {
        let closing_m = (self.own_step_m + self.target_step_m[index]) * (1.0 + ROUNDING) + f64::MIN_POSITIVE;
        ((distance_m * (1.0 - ROUNDING) - reach_m) / closing_m).clamp(0.0, self.steps as f64) as usize
    }

    /// Time of a step, in seconds from now.
    pub fn time_s(&self, step: usize) -> f64 {
        step as f64 * self.step_s
    }

    /// Expected positions of a target ship.
    pub fn target(&self, index: usize) -> &[Position] {
        &self.targets[index]
    }

    /// The CPA of the last manoeuvre that was run with a target ship; `heading` is that of the manoeuvre.
    ///
    /// Steps over which the two cannot come as near as somewhere else are passed over: the result is that of
    /// looking at all of them.
    pub fn passing(&self, index: usize, heading: Nautical) -> Passing {
        let target = &self.targets[index];
        let between = |step: usize| target[step].xy() - self.own[step].xy();
        let bound_m = (0..=self.steps)
            .step_by(COARSE_STEPS)
            .map(|step| between(step).norm())
            .fold(f64::INFINITY, f64::min);
        let mut relative = between(0);
        let mut closest = Passing { distance_m: relative.norm(), time_s: 0.0, starboard_m: 0.0 };
        let mut step = 0;
        while step < self.steps {
            let before = between(step);
            let apart = self.steps_apart(index, before.norm(), bound_m);
            if apart > 0 {
                step += apart;
                continue;
            }
            let approach = Approach::new(before, between(step + 1));
            let within = approach.closest();
            if within.distance_m < closest.distance_m {
                closest.distance_m = within.distance_m;
                closest.time_s = (step as f64 + within.fraction) * self.step_s;
                relative = approach.at(within.fraction);
            }
            step += 1;
        }
        closest.starboard_m =
            Displacement { north_m: relative.y, east_m: relative.x }.starboard_of_m(heading);
        closest
    }
}

/// Deviations from the route that are tried: multiples of `step_deg` up to `max_deg` either way, in radians,
/// from port to starboard.
pub(super) fn deviations(max_deg: f64, step_deg: f64) -> impl Iterator<Item = f64> {
    let count = (max_deg / step_deg).clamp(0.0, MAX_DEVIATIONS) as i32;
    (-count..=count).map(move |k| (f64::from(k) * step_deg).to_radians())
}

impl OwnShip<'_> {
    /// The speeds that may be ordered: fractions of the planned one, or the present one where speed is constant.
    pub(super) fn speeds(&self, fractions: &[f64]) -> Vec<f64> {
        if self.max_speed_change_mps > 0.0 {
            fractions.iter().map(|fraction| fraction * self.planned_speed_mps).collect()
        } else {
            vec![self.velocity.speed_mps()]
        }
    }

    /// How much of the planned speed is missing at a speed: 0 to 1, and 0 for a ship that plans none.
    pub(super) fn slowness(&self, speed_mps: f64) -> f64 {
        if self.planned_speed_mps > 0.0 { (1.0 - speed_mps / self.planned_speed_mps).abs() } else { 0.0 }
    }
}

impl Manoeuvre {
    /// Along the route at the planned speed, aiming `lookahead_m` ahead on it.
    pub fn along_route(situation: &Situation<'_>, lookahead_m: f64) -> Self {
        Self {
            heading: situation.route.course_back(situation.own.position, lookahead_m),
            speed_mps: situation.own.planned_speed_mps,
        }
    }

    /// The command that begins it.
    pub fn command(self, own: &OwnShip<'_>) -> Command {
        let turn_rad = self.heading.turn_from(own.ordered_heading);
        Command {
            turn_rad: turn_rad.clamp(-own.max_turn_rad, own.max_turn_rad),
            speed_mps: (own.max_speed_change_mps > 0.0).then_some(self.speed_mps),
        }
    }

    /// As far as one command gets from what is ordered now.
    fn within_reach(self, ordered: Self, own: &OwnShip<'_>) -> Self {
        let turn_rad = self.heading.turn_from(ordered.heading);
        let change_mps = self.speed_mps - ordered.speed_mps;
        Self {
            heading: if turn_rad.abs() <= own.max_turn_rad {
                self.heading
            } else {
                ordered.heading.turned(turn_rad.clamp(-own.max_turn_rad, own.max_turn_rad))
            },
            speed_mps: if change_mps.abs() <= own.max_speed_change_mps {
                self.speed_mps
            } else {
                ordered.speed_mps + change_mps.clamp(-own.max_speed_change_mps, own.max_speed_change_mps)
            },
        }
    }
}
