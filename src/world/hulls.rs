//! Two hulls within one step, while their centres move evenly and they turn evenly.
//!
//! For a unit vector `n` and hulls `A`, `B` at fraction `s` of the step, with `q(s)` the first centre
//! as seen from the second and `sigma` the support function of a hull, the gap along `n`
//!
//! `h_n(s) = n.q(s) - sigma_B(n, s) - sigma_A(-n, s)`
//!
//! never exceeds the distance `f(s)`, and equals it where `n` is the direction of separation at `s`.
//! `n.q(s)` is affine. A support function is the largest of the corners' sinusoids of amplitude at
//! most `R` (the hull's radius), and each of those stays within `R w^2 / 8` of its chord over any
//! stretch in which the hull turns by `w`. So over any stretch `h_n` lies no more than the *bend*, the
//! sum of that for both hulls, below the line through its end values. These lines, for the
//! directions found at either end, bound `f` from below: branch and bound with them finds the least
//! distance to a proven tolerance. The bend falls with the square of the stretch, and for hulls that
//! do not turn it vanishes.

use nalgebra::Vector2;

use super::centres::{Approach, Closest};
use super::minkowski::{self, Separation};
use super::{Hull, Pose};

/// Cosine and sine of an angle counter-clockwise from east.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rotation {
    cos: f64,
    sin: f64,
}

impl Rotation {
    fn by(angle_rad: f64) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        Self { cos, sin }
    }

    fn apply(self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cos * v.x - self.sin * v.y, self.sin * v.x + self.cos * v.y)
    }

    fn undo(self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cos * v.x + self.sin * v.y, self.cos * v.y - self.sin * v.x)
    }
}

/// How a hull gets to where it is at the end of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HullMotion {
    after: Pose,
    /// Angle turned within the step, counter-clockwise.
    turn_rad: f64,
    rotation_before: Rotation,
    rotation_after: Rotation,
    /// The farthest that a corner swings by the turn, in metres.
    swing_m: f64,
    /// The farthest that a corner's path, seen along any direction, lies from its chord, in metres.
    bend_m: f64,
}

impl HullMotion {
    pub fn new(after: Pose, turn_rad: f64, radius_m: f64) -> Self {
        let rotation_after = Rotation::by(after.angle_rad);
        let rotation_before =
            if turn_rad == 0.0 { rotation_after } else { Rotation::by(after.angle_rad - turn_rad) };
        Self {
            after,
            turn_rad,
            rotation_before,
            rotation_after,
            swing_m: radius_m * turn_rad.abs(),
            bend_m: radius_m * turn_rad * turn_rad / 8.0,
        }
    }

    pub fn still(pose: Pose) -> Self {
        Self::new(pose, 0.0, 0.0)
    }

    pub fn after(&self) -> Pose {
        self.after
    }

    fn rotation(&self, fraction: f64) -> Rotation {
        if fraction == 1.0 || self.turn_rad == 0.0 {
            self.rotation_after
        } else if fraction == 0.0 {
            self.rotation_before
        } else {
            Rotation::by(self.after.angle_rad - self.turn_rad * (1.0 - fraction))
        }
    }
}

/// What a step brought for two hulls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HullEncounter {
    /// At the end of the step.
    pub end: Separation,
    pub closest: Closest,
    /// The first fraction of the step at which the hulls touch.
    pub contact_fraction: Option<f64>,
}

/// The hulls at a fraction of the step.
#[derive(Debug, Clone, Copy)]
struct Sample {
    fraction: f64,
    separation: Separation,
}

impl Sample {
    fn distance_m(&self) -> f64 {
        self.separation.distance_m
    }

    fn closest(&self) -> Closest {
        Closest { distance_m: self.distance_m(), fraction: self.fraction }
    }
}

/// Working memory of the search, kept between steps so that none of them allocates.
#[derive(Debug, Default)]
pub(super) struct HullSweep {
    tolerance_m: f64,
    corners_a: Vec<Vector2<f64>>,
    corners_b: Vec<Vector2<f64>>,
    difference: Vec<Vector2<f64>>,
    stretches: Vec<(Sample, Sample)>,
}

/// Two hulls and how they move.
#[derive(Debug, Clone, Copy)]
pub(super) struct HullPair<'a> {
    pub hulls: [&'a Hull; 2],
    pub motions: [&'a HullMotion; 2],
    pub approach: Approach,
}

impl HullPair<'_> {
    /// The first centre as seen from the second: the point whose distance from the Minkowski
    /// difference is that of the hulls.
    fn point(&self, fraction: f64) -> Vector2<f64> {
        -self.approach.at(fraction)
    }

    /// `h_n(s)`.
    fn gap_along(&self, direction: Vector2<f64>, fraction: f64) -> f64 {
        let support = |index: usize, direction: Vector2<f64>| {
            let own = self.motions[index].rotation(fraction).undo(direction);
            self.hulls[index].outline.iter().map(|corner| corner.dot(&own)).fold(f64::NEG_INFINITY, f64::max)
        };
        direction.dot(&self.point(fraction)) - support(1, direction) - support(0, -direction)
    }

    fn bend_m(&self) -> f64 {
        self.motions.iter().map(|motion| motion.bend_m).sum()
    }

    fn swing_m(&self) -> f64 {
        self.motions.iter().map(|motion| motion.swing_m).sum()
    }

    /// No distance changes by more than this over the whole step.
    fn reach_m(&self) -> f64 {
        (self.approach.after - self.approach.before).norm() + self.swing_m()
    }

    /// A lower bound of the distance over a stretch, and where in it to look next.
    fn bound(&self, left: &Sample, right: &Sample) -> (f64, f64) {
        let width = right.fraction - left.fraction;
        let bend_m = self.bend_m() * width * width;
        let (at_left, at_right) = (left.distance_m(), right.distance_m());
        let from_left = self.gap_along(left.separation.direction, right.fraction);
        let from_right = self.gap_along(right.separation.direction, left.fraction);
        let (lower, part) = if from_left >= at_left {
            (at_left, 0.5)
        } else if from_right >= at_right {
            (at_right, 0.5)
        } else {
            // Where the falling line from the left meets the rising line to the right.
            let (fall, rise) = (at_left - from_right, at_right - from_left);
            let part = if fall + rise > 0.0 { (fall / (fall + rise)).clamp(0.0, 1.0) } else { 0.5 };
            (at_left + (from_left - at_left) * part, part.clamp(0.02, 0.98))
        };
        (lower - bend_m, left.fraction + width * part)
    }
}

impl HullSweep {
    pub fn new(tolerance_m: f64) -> Self {
        Self { tolerance_m, ..Self::default() }
    }

    /// The hulls at the end of a step.
    pub fn end(&mut self, pair: &HullPair<'_>) -> Separation {
        self.sample(pair, 1.0).separation
    }

    /// What a step brings, given the separation at its beginning.
    pub fn run(&mut self, pair: &HullPair<'_>, before: Separation) -> HullEncounter {
        let begin = Sample { fraction: 0.0, separation: before };
        let end = self.sample(pair, 1.0);
        let closest = self.closest(pair, &begin, &end);
        let contact_fraction =
            (closest.distance_m <= self.tolerance_m).then(|| self.first_contact(pair, &begin, closest));
        HullEncounter { end: end.separation, closest, contact_fraction }
    }

    fn closest(&mut self, pair: &HullPair<'_>, begin: &Sample, end: &Sample) -> Closest {
        // Most pairs only come closer, or only draw apart: a line that falls by four times the bend
        // over the step is falling at its end, and so is the distance it bounds.
        let falling = 4.0 * pair.bend_m();
        if begin.distance_m() <= 0.0
            || pair.gap_along(begin.separation.direction, 1.0) - begin.distance_m() >= falling
        {
            return begin.closest();
        }
        if end.distance_m() > 0.0
            && pair.gap_along(end.separation.direction, 0.0) - end.distance_m() >= falling
        {
            return end.closest();
        }
        if self.turns_matter(pair) {
            self.branch_and_bound(pair, begin, end)
        } else {
            minkowski::closest_on_way(&self.difference, pair.point(0.0), pair.point(1.0))
        }
    }

    fn turns_matter(&self, pair: &HullPair<'_>) -> bool {
        pair.swing_m() > 0.1 * self.tolerance_m
    }

    fn branch_and_bound(&mut self, pair: &HullPair<'_>, begin: &Sample, end: &Sample) -> Closest {
        let mut best = if end.distance_m() < begin.distance_m() { end.closest() } else { begin.closest() };
        let reach_m = pair.reach_m();
        self.stretches.clear();
        self.stretches.push((*begin, *end));
        while best.distance_m > 0.0
            && let Some((left, right)) = self.stretches.pop()
        {
            let (lower, split) = pair.bound(&left, &right);
            let width = right.fraction - left.fraction;
            if lower >= best.distance_m - self.tolerance_m || width * reach_m <= self.tolerance_m {
                continue;
            }
            let middle = self.sample(pair, split);
            if middle.distance_m() < best.distance_m {
                best = middle.closest();
            }
            self.stretches.push((left, middle));
            self.stretches.push((middle, right));
        }
        best
    }

    /// The first fraction at which the hulls are within the tolerance, given a moment when they are.
    fn first_contact(&mut self, pair: &HullPair<'_>, begin: &Sample, touching: Closest) -> f64 {
        if !self.turns_matter(pair) || begin.distance_m() <= self.tolerance_m {
            return if begin.distance_m() <= self.tolerance_m { 0.0 } else { touching.fraction };
        }
        let mut contact = touching.fraction;
        let reach_m = pair.reach_m();
        let touch = self.sample(pair, contact);
        self.stretches.clear();
        self.stretches.push((*begin, touch));
        // The leftmost stretch is on top, so that the first contact found ends the search.
        while let Some((left, right)) = self.stretches.pop() {
            let (lower, split) = pair.bound(&left, &right);
            if lower > self.tolerance_m {
                continue;
            }
            let touches = right.distance_m() <= self.tolerance_m;
            if (right.fraction - left.fraction) * reach_m <= self.tolerance_m {
                if touches {
                    contact = right.fraction;
                    break;
                }
                continue;
            }
            let middle = self.sample(pair, split);
            if middle.distance_m() <= self.tolerance_m {
                self.stretches.clear();
            } else {
                self.stretches.push((middle, right));
            }
            self.stretches.push((left, middle));
        }
        contact
    }

    fn sample(&mut self, pair: &HullPair<'_>, fraction: f64) -> Sample {
        for (corners, index) in [(&mut self.corners_a, 0), (&mut self.corners_b, 1)] {
            let rotation = pair.motions[index].rotation(fraction);
            corners.clear();
            corners.extend(pair.hulls[index].outline.iter().map(|corner| rotation.apply(*corner)));
        }
        minkowski::difference(&self.corners_a, &self.corners_b, &mut self.difference);
        Sample { fraction, separation: minkowski::separation(&self.difference, pair.point(fraction)) }
    }
}
