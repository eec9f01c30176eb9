//! The smallest smoothed distance over all times, not only over the time steps.
//!
//! Between two time steps both vessels move straight, so that with `r_k` the relative positions,
//! `d_k = r_{k+1} - r_k` and `u` the fraction of the step, the smoothed distance
//!
//! `f_i(u) = 1/(2n+1) sum_{k=i-n}^{i+n} |r_k + d_k u|`,  `0 <= u <= 1`
//!
//! is convex in `u`. Its minimum within a step is a second-order cone programme,
//!
//! `min 1/(2n+1) sum s_k  s.t.  |r_k + d_k u| <= s_k,  0 <= u <= 1`,
//!
//! solved with Clarabel. The whole curve is not convex, so the global minimum is the smallest over
//! all steps; a step is solved only if it can improve on the best value so far. Two lower bounds rule
//! steps out: `(f_i(0) + f_i(1) - mean |d_k|) / 2`, since no slope exceeds `mean |d_k|`, and the point
//! where the tangents at both ends meet. Where a tangent does not point into the step, the minimum
//! is at that end, a time step.
//!
//! **Accuracy.** The reported distance is `f_i` evaluated at the solver's `u`, clamped to the step,
//! so that it is always attained at the reported time. With the default tolerances it lies at most
//! `1e-6` of itself plus 1 mm above the true minimum. Improvements under 0.1 micrometres are not
//! sought. With `n = 0` each step has a closed form and no solver is called: the result is the exact
//! CPA of the two polylines.

use std::fmt;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT,
    SolverStatus,
};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::Cpa;
use super::sampled::{DistanceCurve, TIE_M};

/// Tolerances of the cone solver. The data are scaled so that lengths are about 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefineConfig {
    /// Absolute and relative duality gap.
    pub gap_tolerance: f64,
    /// Feasibility of primal and dual.
    pub feasibility_tolerance: f64,
    /// Iterations after which a solve counts as failed.
    pub max_iterations: u32,
}

impl Default for RefineConfig {
    fn default() -> Self {
        Self { gap_tolerance: 1e-8, feasibility_tolerance: 1e-8, max_iterations: 100 }
    }
}

/// A CPA and what it took to find it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RefinedCpa {
    /// The closest point of approach.
    pub cpa: Cpa,
    /// Steps on which the cone solver was called.
    pub solves: usize,
    /// Those of them that the solver did not report as solved; there the sampled distances at both
    /// ends of the step stand.
    pub fallbacks: usize,
}

/// Finds refined CPAs. The cone programme is set up once per width of the moving average; after that
/// only its numbers change.
#[derive(Debug)]
pub struct Refiner {
    config: RefineConfig,
    programme: Option<ConeProgramme>,
    lengths_m: Vec<f64>,
}

impl Clone for Refiner {
    fn clone(&self) -> Self {
        Self::new(self.config)
    }
}

/// The best value found so far.
struct Best {
    cpa: Cpa,
    solves: usize,
    fallbacks: usize,
}

impl Refiner {
    /// A refiner that sets up its cone programme when it first needs it.
    #[must_use]
    pub fn new(config: RefineConfig) -> Self {
        Self { config, programme: None, lengths_m: Vec::new() }
    }

    /// The smallest smoothed distance over all times that have one; of equal ones that nearest to
    /// now. [`Cpa::UNKNOWN`] where [`DistanceCurve::closest`] is.
    pub fn closest(&mut self, curve: &DistanceCurve) -> RefinedCpa {
        let Some(sampled) = curve.closest_index() else {
            return RefinedCpa { cpa: Cpa::UNKNOWN, solves: 0, fallbacks: 0 };
        };
        self.lengths_m.clear();
        self.lengths_m.extend(curve.relative().windows(2).map(|pair| (pair[1] - pair[0]).norm()));

        let mut best = Best { cpa: curve.closest(), solves: 0, fallbacks: 0 };
        // The steps beside the best sample come first: what they find rules out most others.
        let beside = sampled.saturating_sub(1)..(sampled + 1).min(curve.smoothed_m().len() - 1);
        for step in beside.clone() {
            self.improve(curve, step, &mut best);
        }
        for step in (0..curve.smoothed_m().len() - 1).filter(|step| !beside.contains(step)) {
            self.improve(curve, step, &mut best);
        }
        RefinedCpa { cpa: best.cpa, solves: best.solves, fallbacks: best.fallbacks }
    }

    /// Replaces the best value by the minimum within a step, where that is smaller.
    fn improve(&mut self, curve: &DistanceCurve, step: usize, best: &mut Best) {
        let terms = 2 * curve.half_width() + 1;
        let lengths_m = &self.lengths_m[step..step + terms];
        let ends_m = [curve.smoothed_m()[step], curve.smoothed_m()[step + 1]];
        let steepest = lengths_m.iter().sum::<f64>() / terms as f64;
        let wanted_m = best.cpa.distance_m - TIE_M;
        if 0.5 * (ends_m[0] + ends_m[1] - steepest) >= wanted_m {
            return;
        }
        let within = Within { positions: &curve.relative()[step..=step + terms], lengths_m };
        if within.tangent_bound(ends_m).is_none_or(|bound| bound >= wanted_m) {
            return;
        }
        let fraction = if terms == 1 {
            Some(within.single_minimum())
        } else {
            best.solves += 1;
            let programme = match &mut self.programme {
                Some(programme) if programme.terms == terms => programme,
                other => other.insert(ConeProgramme::new(terms, self.config)),
            };
            let solution = programme.solve(&within);
            best.fallbacks += usize::from(solution.is_none());
            solution
        };
        if let Some(fraction) = fraction {
            let distance_m = within.distance_m(fraction);
            if distance_m < wanted_m {
                let time_s = curve.smoothed_time_s(step) + fraction * curve.dt_s();
                best.cpa = Cpa { distance_m, time_s };
            }
        }
    }
}

/// The smoothed distance within one step.
struct Within<'a> {
    /// The relative positions `r_k`, and the one after the last of them.
    positions: &'a [Vector2<f64>],
    /// The lengths `|d_k|`.
    lengths_m: &'a [f64],
}

impl Within<'_> {
    /// Each term's position at the start of the step and its way within it: `r_k`, `d_k`.
    fn terms(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
        self.positions.windows(2).map(|pair| (pair[0], pair[1] - pair[0]))
    }

    /// `f(u)`.
    fn distance_m(&self, fraction: f64) -> f64 {
        let sum: f64 = self.terms().map(|(start, way)| (start + way * fraction).norm()).sum();
        sum / self.lengths_m.len() as f64
    }

    /// Where the tangents at both ends meet: no value within the step is smaller. Nothing where the
    /// minimum is at an end.
    fn tangent_bound(&self, ends_m: [f64; 2]) -> Option<f64> {
        let slope = |position: Vector2<f64>, way: Vector2<f64>, at_zero: f64| {
            let distance_m = position.norm();
            if distance_m > 0.0 { position.dot(&way) / distance_m } else { at_zero }
        };
        let mut slopes = [0.0; 2];
        for ((start, way), length_m) in self.terms().zip(self.lengths_m) {
            slopes[0] += slope(start, way, *length_m);
            slopes[1] += slope(start + way, way, -length_m);
        }
        let slopes = slopes.map(|sum| sum / self.lengths_m.len() as f64);
        (slopes[0] < 0.0 && slopes[1] > 0.0).then(|| {
            let fraction = (ends_m[0] - ends_m[1] + slopes[1]) / (slopes[1] - slopes[0]);
            ends_m[0] + slopes[0] * fraction.clamp(0.0, 1.0)
        })
    }

    /// The minimum of a single term, by the closed form.
    fn single_minimum(&self) -> f64 {
        let (start, way) = (self.positions[0], self.positions[1] - self.positions[0]);
        (-start.dot(&way) / way.norm_squared()).clamp(0.0, 1.0)
    }
}

/// The cone programme of one step, over the variables `v, s_1 ... s_m`: `v` runs from the middle of
/// the step, and all lengths are divided by the same scale.
///
/// Clarabel's form is `min q'x  s.t.  A x + z = b, z in K`, with two rows for the range of `v` and
/// three rows `(s_k, c_k + e_k v)` for each second-order cone.
struct ConeProgramme {
    terms: usize,
    solver: DefaultSolver<f64>,
    /// The values of `A`, column by column.
    matrix: Vec<f64>,
    right_side: Vec<f64>,
}

impl fmt::Debug for ConeProgramme {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ConeProgramme").field("terms", &self.terms).finish_non_exhaustive()
    }
}

const RANGE_ROWS: usize = 2;
const CONE_ROWS: usize = 3;

impl ConeProgramme {
    fn new(terms: usize, config: RefineConfig) -> Self {
        let rows = RANGE_ROWS + CONE_ROWS * terms;
        let columns = 1 + terms;
        let cone_row = |term: usize| RANGE_ROWS + CONE_ROWS * term;

        let mut row_of: Vec<usize> = (0..RANGE_ROWS).collect();
        row_of.extend((0..terms).flat_map(|term| [cone_row(term) + 1, cone_row(term) + 2]));
        let mut column_start = vec![0, row_of.len()];
        let mut matrix = vec![1.0; row_of.len()];
        matrix[0] = -1.0;
        for term in 0..terms {
            row_of.push(cone_row(term));
            matrix.push(-1.0);
            column_start.push(row_of.len());
        }
        let mut objective = vec![1.0 / terms as f64; columns];
        objective[0] = 0.0;
        let right_side = vec![0.5; rows];
        let cones: Vec<_> = std::iter::once(NonnegativeConeT(RANGE_ROWS))
            .chain((0..terms).map(|_| SecondOrderConeT(CONE_ROWS)))
            .collect();

        let solver = DefaultSolver::new(
            &CscMatrix::zeros((columns, columns)),
            &objective,
            &CscMatrix::new(rows, columns, column_start, row_of, matrix.clone()),
            &right_side,
            &cones,
            settings(config),
        )
        .expect("the dimensions above agree and the settings are valid");
        Self { terms, solver, matrix, right_side }
    }

    /// The fraction of the step at which the smoothed distance is smallest; nothing where the solver
    /// does not report the programme as solved.
    fn solve(&mut self, within: &Within<'_>) -> Option<f64> {
        // Positions in the middle of the step, and ways, both about 1: the ways through `v`, which
        // is the fraction from the middle in units of `longest / largest`.
        let longest_m = within.lengths_m.iter().copied().fold(0.0, f64::max);
        let middle = |(start, way): (Vector2<f64>, Vector2<f64>)| start + way * 0.5;
        let largest_m = within.terms().map(|term| middle(term).amax()).fold(longest_m, f64::max);
        let half_range = 0.5 * longest_m / largest_m;

        self.right_side[..RANGE_ROWS].fill(half_range);
        for (term, (start, way)) in within.terms().enumerate() {
            let at = RANGE_ROWS + 2 * term;
            self.matrix[at] = -way.x / longest_m;
            self.matrix[at + 1] = -way.y / longest_m;
            let row = RANGE_ROWS + CONE_ROWS * term;
            let centre = middle((start, way)) / largest_m;
            self.right_side[row..row + CONE_ROWS].copy_from_slice(&[0.0, centre.x, centre.y]);
        }
        self.solver.update_A(&self.matrix).ok()?;
        self.solver.update_b(&self.right_side).ok()?;
        self.solver.solve();
        let solution = &self.solver.solution;
        let solved = solution.status == SolverStatus::Solved && solution.x[0].is_finite();
        solved.then(|| (0.5 + 0.5 * solution.x[0] / half_range).clamp(0.0, 1.0))
    }
}

fn settings(config: RefineConfig) -> DefaultSettings<f64> {
    DefaultSettingsBuilder::default()
        .verbose(false)
        .max_iter(config.max_iterations)
        .tol_gap_abs(config.gap_tolerance)
        .tol_gap_rel(config.gap_tolerance)
        .tol_feas(config.feasibility_tolerance)
        // Scaled data of this size need no second solve of each system; it would cost a third more.
        .iterative_refinement_enable(false)
        // The data are scaled here, for each step anew; Clarabel would keep the scaling of the first.
        .equilibrate_enable(false)
        // Data updates are refused where presolving has changed the structure.
        .presolve_enable(false)
        .build()
        .expect("every setting has a value")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn refine(half_width: usize, relative: &[Vector2<f64>]) -> (RefinedCpa, Cpa) {
        let mut curve = DistanceCurve::new(half_width);
        curve.fill_relative(relative.iter().copied(), half_width, 5.0);
        (Refiner::new(RefineConfig::default()).closest(&curve), curve.closest())
    }

    fn line(start: Vector2<f64>, way: Vector2<f64>, steps: usize) -> Vec<Vector2<f64>> {
        (0..steps).map(|step| start + way * step as f64).collect()
    }

    #[test]
    fn equal_motions_are_closest_now_and_need_no_solver() {
        let (refined, sampled) = refine(10, &[Vector2::new(30.0, 40.0); 60]);
        assert_eq!(refined, RefinedCpa { cpa: sampled, solves: 0, fallbacks: 0 });
        assert_eq!(refined.cpa, Cpa { distance_m: 50.0, time_s: 0.0 });
    }

    #[test]
    fn vessels_in_one_place_are_at_distance_zero() {
        for half_width in [0, 10] {
            let (refined, _) = refine(half_width, &[Vector2::zeros(); 40]);
            assert_eq!(refined.cpa, Cpa { distance_m: 0.0, time_s: 0.0 });
        }
    }

    #[test]
    fn a_collision_within_a_step_is_found_exactly() {
        // Through own ship 0.3 of a step after step 20.
        let way = Vector2::new(24.0, -32.0);
        let (refined, sampled) = refine(0, &line(-way * 20.3, way, 40));
        assert!(refined.cpa.distance_m < 1e-9 && sampled.distance_m > 10.0, "{refined:?}");
        assert!((refined.cpa.time_s - 101.5).abs() < 1e-9);
        // Smoothed, the terms pass through zero one after the other; the mean stays positive.
        let (refined, sampled) = refine(10, &line(-way * 20.3, way, 60));
        assert_eq!(refined.fallbacks, 0);
        assert!(refined.cpa.distance_m <= sampled.distance_m && refined.cpa.distance_m > 100.0);
    }

    #[test]
    fn the_shortest_row_is_one_step_and_one_sample_is_enough() {
        let way = Vector2::new(0.0, 30.0);
        let (refined, _) = refine(10, &line(Vector2::new(7.0, -315.0), way, 22));
        assert!((refined.cpa.time_s - 2.5).abs() < 1e-4, "{refined:?}");
        let (refined, sampled) = refine(10, &line(Vector2::new(7.0, -300.0), way, 21));
        assert_eq!(refined, RefinedCpa { cpa: sampled, solves: 0, fallbacks: 0 });
    }

    #[test]
    fn too_few_or_broken_positions_give_an_unknown_cpa() {
        let mut broken = line(Vector2::zeros(), Vector2::new(1.0, 2.0), 60);
        broken[30].y = f64::NAN;
        for relative in [&[][..], &[Vector2::zeros(); 20], &broken] {
            let (refined, _) = refine(10, relative);
            assert!(refined.cpa.distance_m.is_nan() && refined.cpa.time_s.is_nan());
            assert_eq!((refined.solves, refined.fallbacks), (0, 0));
        }
    }

    #[test]
    fn a_solver_that_gives_up_is_counted_and_the_samples_stand() {
        let relative = line(Vector2::new(40.0, -615.0), Vector2::new(1.0, 30.0), 42);
        let mut curve = DistanceCurve::new(10);
        curve.fill_relative(relative.iter().copied(), 10, 5.0);
        let hasty = RefineConfig { max_iterations: 1, ..RefineConfig::default() };
        let given_up = Refiner::new(hasty).closest(&curve);
        assert_eq!(given_up.cpa, curve.closest());
        assert!(given_up.fallbacks >= 1 && given_up.fallbacks == given_up.solves);
        let solved = Refiner::new(RefineConfig::default()).closest(&curve);
        assert!(solved.fallbacks == 0 && solved.cpa.distance_m < given_up.cpa.distance_m);
    }

    #[test]
    fn scales_from_millimetres_to_a_thousand_kilometres_are_solved() {
        for scale in [1e-3, 1.0, 1e3, 1e6] {
            let relative: Vec<_> = (0..50)
                .map(|step| {
                    let along = f64::from(step) - 24.6;
                    Vector2::new(along * 1.0, 3.0 + 0.7 * (0.8 * along).sin()) * scale
                })
                .collect();
            let (refined, sampled) = refine(10, &relative);
            assert_eq!(refined.fallbacks, 0, "scale {scale}");
            assert!(refined.cpa.distance_m <= sampled.distance_m);
        }
    }

    proptest! {
        #[test]
        fn it_is_never_above_the_samples_nor_far_below(
            points in prop::collection::vec((-300.0..300.0_f64, -300.0..300.0_f64), 25..40),
            half_width in 0..6_usize,
        ) {
            let relative: Vec<_> = points.iter().map(|&(x, y)| Vector2::new(x, y)).collect();
            let (refined, sampled) = refine(half_width, &relative);
            prop_assert_eq!(refined.fallbacks, 0);
            prop_assert!(refined.cpa.distance_m <= sampled.distance_m);
            let longest_m = relative.windows(2).map(|w| (w[1] - w[0]).norm()).fold(0.0, f64::max);
            prop_assert!(refined.cpa.distance_m >= sampled.distance_m - 0.5 * longest_m - 1e-9);
        }

        /// Turning the plane changes no distance.
        #[test]
        fn the_axes_do_not_matter(
            points in prop::collection::vec((-300.0..300.0_f64, -300.0..300.0_f64), 25..30),
            angle in 0.0..6.3_f64,
        ) {
            let turn = nalgebra::Rotation2::new(angle);
            let relative: Vec<_> = points.iter().map(|&(x, y)| Vector2::new(x, y)).collect();
            let turned: Vec<_> = relative.iter().map(|p| turn * p).collect();
            let (before, after) = (refine(10, &relative).0.cpa, refine(10, &turned).0.cpa);
            prop_assert!((before.distance_m - after.distance_m).abs() <= 1e-6 * before.distance_m);
        }
    }
}
