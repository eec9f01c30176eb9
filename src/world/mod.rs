//! The rigid-body world: vessels as bodies with a hull and a collision circle, and what happens
//! between them inside a time step.
//!
//! This is the only module that names rapier. Every vessel is a kinematic, position-based body:
//! where it goes next is computed outside (a replay, a script, a vessel's own dynamics) and the world
//! says who came how close to whom. Within a step every vessel moves in a straight line at constant
//! speed and its heading turns the short way at a constant rate.
//!
//! | quantity | how | error |
//! | --- | --- | --- |
//! | centre distance, circle contact | closed form | rounding |
//! | hull distance, no vessel turning | moving point against the Minkowski difference | rounding |
//! | hull distance, a vessel turning | branch and bound with proven lower bounds | [`WorldConfig::hull_tolerance_m`] |
//!
//! Axes in here are those of [`crate::geo::Position::xy`]: x to the east, y to the north; angles are
//! counter-clockwise from east.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::vessel::VesselState;

mod bodies;
mod centres;
pub mod hull;
mod hulls;
mod minkowski;

pub use bodies::Overlap;
pub use hull::{Bow, Hull, HullError, HullPoint};

use bodies::Bodies;
pub(crate) use centres::Approach;
use hulls::{HullMotion, HullPair, HullSweep};
use minkowski::Separation;

/// Settings of a world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorldConfig {
    /// Time between two steps, in seconds.
    pub dt_s: f64,
    /// Hulls closer than this touch, and the least hull distance is this good while vessels turn,
    /// in metres.
    pub hull_tolerance_m: f64,
}

impl Default for WorldConfig {
    fn default() -> Self {
        Self { dt_s: 5.0, hull_tolerance_m: 1e-3 }
    }
}

/// The shapes of a vessel.
#[derive(Debug, Clone, PartialEq)]
pub struct VesselBody {
    /// Its outline at the waterline.
    pub hull: Hull,
    /// Radius of its collision circle, in metres; the circles of two vessels touch when their centres
    /// are no further apart than the sum of their radii.
    pub collision_radius_m: f64,
}

/// A vessel of one world, numbered from 0 in the order in which vessels were added.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct VesselId(pub usize);

/// What happened between two vessels in the last step.
///
/// Times are seconds since the start of the world. Before the first step, and after a reset, the
/// minima are those of the start itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairReport {
    /// The first vessel of the pair.
    pub a: VesselId,
    /// The second vessel of the pair.
    pub b: VesselId,
    /// Distance between centres at the end of the step, in metres.
    pub centre_distance_m: f64,
    /// Distance between hulls at the end of the step, in metres; zero where they overlap.
    pub hull_distance_m: f64,
    /// Least distance between centres at any time within the step, in metres.
    pub min_centre_distance_m: f64,
    /// When centres were closest.
    pub min_centre_time_s: f64,
    /// Least distance between hulls at any time within the step, in metres; zero where they overlap.
    pub min_hull_distance_m: f64,
    /// When hulls were closest.
    pub min_hull_time_s: f64,
    /// Since when within the step the collision circles have touched; `None` where they never do.
    pub circle_contact_time_s: Option<f64>,
    /// When within the step the hulls first touched; `None` where they never do.
    pub hull_contact_time_s: Option<f64>,
}

impl PairReport {
    /// Whether the collision circles touched at any time within the step.
    #[must_use]
    pub fn circles_touch(&self) -> bool {
        self.circle_contact_time_s.is_some()
    }

    /// Whether the hulls touched at any time within the step.
    #[must_use]
    pub fn hulls_touch(&self) -> bool {
        self.hull_contact_time_s.is_some()
    }
}

/// Where a body is, in the world's axes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pose {
    centre: Vector2<f64>,
    angle_rad: f64,
}

impl Pose {
    fn of(state: &VesselState) -> Self {
        Self { centre: state.position.xy(), angle_rad: FRAC_PI_2 - state.heading.radians() }
    }
}

#[derive(Debug)]
struct Vessel {
    body: VesselBody,
    state: VesselState,
    /// The way from the last state to this one.
    motion: HullMotion,
    centre_before: Vector2<f64>,
}

impl Vessel {
    fn new(body: VesselBody, state: VesselState) -> Self {
        let pose = Pose::of(&state);
        Self { body, state, motion: HullMotion::still(pose), centre_before: pose.centre }
    }

    fn move_to(&mut self, state: &VesselState) {
        let turn_rad = -state.heading.turn_from(self.state.heading);
        self.centre_before = self.motion.after().centre;
        self.motion = HullMotion::new(Pose::of(state), turn_rad, self.body.hull.radius_m());
        self.state = *state;
    }

    fn put(&mut self, state: &VesselState) {
        let pose = Pose::of(state);
        self.motion = HullMotion::still(pose);
        self.centre_before = pose.centre;
        self.state = *state;
    }
}

/// Vessels, the pairs that are watched, and what the last step brought for them.
#[derive(Debug)]
pub struct World {
    config: WorldConfig,
    steps: u64,
    vessels: Vec<Vessel>,
    bodies: Bodies,
    reports: Vec<PairReport>,
    /// How the hulls of each watched pair lie at the end of the last step.
    separations: Vec<Separation>,
    sweep: HullSweep,
}

impl World {
    /// An empty world at time 0.
    #[must_use]
    pub fn new(config: WorldConfig) -> Self {
        Self {
            config,
            steps: 0,
            vessels: Vec::new(),
            bodies: Bodies::new(),
            reports: Vec::new(),
            separations: Vec::new(),
            sweep: HullSweep::new(config.hull_tolerance_m),
        }
    }

    /// Puts a vessel into the world.
    pub fn add_vessel(&mut self, body: VesselBody, state: VesselState) -> VesselId {
        self.bodies.add(&body, Pose::of(&state));
        self.vessels.push(Vessel::new(body, state));
        VesselId(self.vessels.len() - 1)
    }

    /// Reports on a pair of vessels from now on; the index of its report is returned.
    ///
    /// # Panics
    /// Where a vessel is not of this world, or both are the same.
    pub fn watch(&mut self, a: VesselId, b: VesselId) -> usize {
        assert!(a != b && a.0.max(b.0) < self.vessels.len(), "{a:?} and {b:?} are no pair of this world");
        let (report, separation) = self.report_now(a, b);
        self.reports.push(report);
        self.separations.push(separation);
        self.reports.len() - 1
    }

    /// Reports on every pair of vessels that is not watched yet.
    pub fn watch_all(&mut self) {
        for b in 0..self.vessels.len() {
            for a in 0..b {
                if !self.reports.iter().any(|known| (known.a.0, known.b.0) == (a, b)) {
                    self.watch(VesselId(a), VesselId(b));
                }
            }
        }
    }

    /// Moves every vessel to its next state, one time step on, and reports on the watched pairs in
    /// the order in which they were watched.
    ///
    /// # Panics
    /// Where `next` does not hold one state for each vessel.
    pub fn step(&mut self, next: &[VesselState]) -> &[PairReport] {
        assert_eq!(next.len(), self.vessels.len(), "one next state for each vessel");
        self.steps += 1;
        for (index, (vessel, state)) in self.vessels.iter_mut().zip(next).enumerate() {
            vessel.move_to(state);
            self.bodies.put(index, vessel.motion.after());
        }
        self.bodies.detect();
        for index in 0..self.reports.len() {
            self.report_step(index);
        }
        &self.reports
    }

    /// Puts every vessel at a new place and sets the time back to 0, keeping bodies and pairs.
    ///
    /// # Panics
    /// Where `states` does not hold one state for each vessel.
    pub fn reset(&mut self, states: &[VesselState]) -> &[PairReport] {
        assert_eq!(states.len(), self.vessels.len(), "one state for each vessel");
        self.steps = 0;
        for (index, (vessel, state)) in self.vessels.iter_mut().zip(states).enumerate() {
            vessel.put(state);
            self.bodies.put(index, vessel.motion.after());
        }
        self.bodies.detect();
        for index in 0..self.reports.len() {
            let (a, b) = (self.reports[index].a, self.reports[index].b);
            (self.reports[index], self.separations[index]) = self.report_now(a, b);
        }
        &self.reports
    }

    /// Puts one vessel elsewhere without moving it there: the next step starts from this state, and
    /// the reports on its pairs are those of this moment.
    ///
    /// # Panics
    /// Where the vessel is not of this world.
    pub fn place(&mut self, vessel: VesselId, state: &VesselState) {
        self.vessels[vessel.0].put(state);
        self.bodies.put(vessel.0, self.vessels[vessel.0].motion.after());
        for index in 0..self.reports.len() {
            let (a, b) = (self.reports[index].a, self.reports[index].b);
            if a == vessel || b == vessel {
                (self.reports[index], self.separations[index]) = self.report_now(a, b);
            }
        }
    }

    /// What the last step brought for the watched pairs, in the order in which they were watched.
    #[must_use]
    pub fn reports(&self) -> &[PairReport] {
        &self.reports
    }

    /// The present state of a vessel.
    ///
    /// # Panics
    /// Where the vessel is not of this world.
    #[must_use]
    pub fn state(&self, vessel: VesselId) -> &VesselState {
        &self.vessels[vessel.0].state
    }

    /// The shapes of a vessel.
    ///
    /// # Panics
    /// Where the vessel is not of this world.
    #[must_use]
    pub fn body(&self, vessel: VesselId) -> &VesselBody {
        &self.vessels[vessel.0].body
    }

    /// How many vessels there are.
    #[must_use]
    pub fn vessel_count(&self) -> usize {
        self.vessels.len()
    }

    /// Seconds since the start.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.config.dt_s
    }

    /// What rapier's own narrow phase says of two vessels at the end of the last step.
    ///
    /// # Panics
    /// Where a vessel is not of this world.
    #[must_use]
    pub fn overlap(&self, a: VesselId, b: VesselId) -> Overlap {
        self.bodies.overlap(a.0, b.0)
    }

    /// The report on a pair at this very moment, and how their hulls lie.
    fn report_now(&mut self, a: VesselId, b: VesselId) -> (PairReport, Separation) {
        let (one, other) = (&self.vessels[a.0], &self.vessels[b.0]);
        let between = other.state.position.xy() - one.state.position.xy();
        let still = [HullMotion::still(one.motion.after()), HullMotion::still(other.motion.after())];
        let pair = HullPair {
            hulls: [&one.body.hull, &other.body.hull],
            motions: [&still[0], &still[1]],
            approach: Approach::new(between, between),
        };
        let separation = self.sweep.end(&pair);
        let now_s = self.time_s();
        let centre_distance_m = between.norm();
        let circles_touch = centre_distance_m <= one.body.collision_radius_m + other.body.collision_radius_m;
        let hulls_touch = separation.distance_m <= self.config.hull_tolerance_m;
        let report = PairReport {
            a,
            b,
            centre_distance_m,
            hull_distance_m: separation.distance_m,
            min_centre_distance_m: centre_distance_m,
            min_centre_time_s: now_s,
            min_hull_distance_m: separation.distance_m,
            min_hull_time_s: now_s,
            circle_contact_time_s: circles_touch.then_some(now_s),
            hull_contact_time_s: hulls_touch.then_some(now_s),
        };
        (report, separation)
    }

    /// Writes the report on the last step for one watched pair.
    fn report_step(&mut self, index: usize) {
        let PairReport { a, b, .. } = self.reports[index];
        let (one, other) = (&self.vessels[a.0], &self.vessels[b.0]);
        let approach = Approach::new(
            other.centre_before - one.centre_before,
            other.motion.after().centre - one.motion.after().centre,
        );
        let pair = HullPair {
            hulls: [&one.body.hull, &other.body.hull],
            motions: [&one.motion, &other.motion],
            approach,
        };
        let hulls = self.sweep.run(&pair, self.separations[index]);
        let centres = approach.closest();
        let radii_m = one.body.collision_radius_m + other.body.collision_radius_m;
        let at = |fraction: f64| (self.steps as f64 - 1.0 + fraction) * self.config.dt_s;
        self.reports[index] = PairReport {
            a,
            b,
            centre_distance_m: approach.after.norm(),
            hull_distance_m: hulls.end.distance_m,
            min_centre_distance_m: centres.distance_m,
            min_centre_time_s: at(centres.fraction),
            min_hull_distance_m: hulls.closest.distance_m,
            min_hull_time_s: at(hulls.closest.fraction),
            circle_contact_time_s: approach.first_within(radii_m).map(at),
            hull_contact_time_s: hulls.contact_fraction.map(at),
        };
        self.separations[index] = hulls.end;
    }
}

#[cfg(test)]
mod tests;
