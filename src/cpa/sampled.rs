//! The distance of two vessels at every time step, smoothed, and its smallest value (the paper's
//! section on collision risk estimation).

use nalgebra::Vector2;

use super::{Cpa, StraightMotion};

/// Distances closer together than this are one distance, and the time nearest to now is taken: of
/// two vessels with equal motions, as with [`linear::closest_approach`](super::linear), the CPA is
/// now. Rounding stays far below it.
pub(super) const TIE_M: f64 = 1e-7;

/// Raw and smoothed distance over a row of time steps. The buffers are kept from fill to fill.
///
/// The moving average is symmetric, `2 n + 1` steps wide, and has its valid part only: the first
/// and the last `n` steps have no smoothed distance.
#[derive(Debug, Clone)]
pub struct DistanceCurve {
    half_width: usize,
    now: usize,
    dt_s: f64,
    relative: Vec<Vector2<f64>>,
    raw_m: Vec<f64>,
    smoothed_m: Vec<f64>,
}

impl DistanceCurve {
    /// An empty curve, to be smoothed over `half_width` steps either side.
    #[must_use]
    pub fn new(half_width: usize) -> Self {
        Self { half_width, now: 0, dt_s: 1.0, relative: vec![], raw_m: vec![], smoothed_m: vec![] }
    }

    /// Takes own ship on a straight line and the target ship's positions, `dt_s` apart; position
    /// number `now` is the present one.
    pub fn fill(
        &mut self,
        own: StraightMotion,
        target: impl IntoIterator<Item = Vector2<f64>>,
        now: usize,
        dt_s: f64,
    ) {
        let start = own.position - own.velocity * (dt_s * now as f64);
        let relative = |(step, position)| position - start - own.velocity * (dt_s * step as f64);
        self.fill_relative(target.into_iter().enumerate().map(relative), now, dt_s);
    }

    /// Takes the target ship's positions relative to own ship, for an own ship on any path.
    pub fn fill_relative(&mut self, relative: impl IntoIterator<Item = Vector2<f64>>, now: usize, dt_s: f64) {
        self.now = now;
        self.dt_s = dt_s;
        self.relative.clear();
        self.relative.extend(relative);
        self.raw_m.clear();
        self.raw_m.extend(self.relative.iter().map(|position| position.x.hypot(position.y)));
        self.smoothed_m.clear();
        let width = 2 * self.half_width + 1;
        let mean = |window: &[f64]| window.iter().sum::<f64>() / width as f64;
        self.smoothed_m.extend(self.raw_m.windows(width).map(mean));
    }

    /// Steps averaged either side of each.
    #[must_use]
    pub fn half_width(&self) -> usize {
        self.half_width
    }

    /// Time between two steps, in seconds.
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// The target ship's positions relative to own ship.
    #[must_use]
    pub fn relative(&self) -> &[Vector2<f64>] {
        &self.relative
    }

    /// The distance at every step, in metres.
    #[must_use]
    pub fn raw_m(&self) -> &[f64] {
        &self.raw_m
    }

    /// The smoothed distance, in metres; value `i` belongs to step `half_width + i`.
    #[must_use]
    pub fn smoothed_m(&self) -> &[f64] {
        &self.smoothed_m
    }

    /// The smoothed distance between two time steps, in metres: a `fraction` of the step that begins
    /// with smoothed distance `index`, both vessels moving straight.
    ///
    /// # Panics
    /// Where there is no smoothed distance `index + 1`.
    #[must_use]
    pub fn smoothed_within_m(&self, index: usize, fraction: f64) -> f64 {
        let width = 2 * self.half_width + 1;
        let pairs = self.relative[index..=index + width].windows(2);
        let sum: f64 = pairs.map(|pair| pair[0].lerp(&pair[1], fraction).norm()).sum();
        sum / width as f64
    }

    /// Time of a step, in seconds from now.
    #[must_use]
    pub fn time_s(&self, step: usize) -> f64 {
        (step as f64 - self.now as f64) * self.dt_s
    }

    /// Time of smoothed distance `index`, in seconds from now.
    #[must_use]
    pub fn smoothed_time_s(&self, index: usize) -> f64 {
        self.time_s(index + self.half_width)
    }

    /// The sampled CPA: the smallest smoothed distance and its time, the nearest to now where there
    /// are several. [`Cpa::UNKNOWN`] where the row is shorter than the moving average or has a
    /// position that is not finite.
    #[must_use]
    pub fn closest(&self) -> Cpa {
        self.closest_index().map_or(Cpa::UNKNOWN, |index| Cpa {
            distance_m: self.smoothed_m[index],
            time_s: self.smoothed_time_s(index),
        })
    }

    /// The smoothed distance that [`Self::closest`] reports.
    pub(super) fn closest_index(&self) -> Option<usize> {
        if self.raw_m.iter().any(|distance| !distance.is_finite()) || !self.dt_s.is_finite() {
            return None;
        }
        let smallest = self.smoothed_m.iter().copied().fold(f64::INFINITY, f64::min);
        let is_smallest = |&index: &usize| self.smoothed_m[index] <= smallest + TIE_M;
        let from_now = |index: usize| (index + self.half_width).abs_diff(self.now);
        (0..self.smoothed_m.len()).rev().filter(is_smallest).min_by_key(|&index| from_now(index))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::cpa::linear;

    const STILL: StraightMotion =
        StraightMotion { position: Vector2::new(0.0, 0.0), velocity: Vector2::new(0.0, 0.0) };

    fn straight(
        position: Vector2<f64>,
        velocity: Vector2<f64>,
        now: usize,
        steps: usize,
    ) -> Vec<Vector2<f64>> {
        (0..steps).map(|step| position + velocity * (5.0 * (step as f64 - now as f64))).collect()
    }

    #[test]
    fn the_average_has_its_valid_part_only() {
        let mut curve = DistanceCurve::new(1);
        let target = [3.0, 9.0, 6.0, 0.0].map(|x| Vector2::new(x, 0.0));
        curve.fill(STILL, target, 1, 5.0);
        assert_eq!(curve.raw_m(), [3.0, 9.0, 6.0, 0.0]);
        assert_eq!(curve.smoothed_m(), [6.0, 5.0]);
        assert_eq!(curve.closest(), Cpa { distance_m: 5.0, time_s: 5.0 });
    }

    #[test]
    fn between_steps_the_terms_move_straight() {
        let mut curve = DistanceCurve::new(1);
        curve.fill(STILL, [3.0, 9.0, 6.0, 0.0, -8.0].map(|x| Vector2::new(x, 0.0)), 1, 5.0);
        assert_eq!(curve.smoothed_within_m(0, 0.0), curve.smoothed_m()[0]);
        assert_eq!(curve.smoothed_within_m(1, 1.0), curve.smoothed_m()[2]);
        // 7.5, 3 and 4 metres away half way from the second to the third.
        assert!((curve.smoothed_within_m(1, 0.5) - 14.5 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn equal_motions_are_closest_now() {
        let velocity = Vector2::new(3.1, -1.7);
        let own = StraightMotion { position: Vector2::new(1e5, 7.0), velocity };
        let mut curve = DistanceCurve::new(10);
        curve.fill(own, straight(own.position + Vector2::new(30.0, 40.0), velocity, 100, 210), 100, 5.0);
        let cpa = curve.closest();
        assert!((cpa.distance_m - 50.0).abs() < 1e-9 && cpa.time_s == 0.0, "{cpa:?}");
    }

    #[test]
    fn where_now_has_no_smoothed_distance_the_nearest_time_that_has_one_is_taken() {
        let mut curve = DistanceCurve::new(2);
        curve.fill(STILL, vec![Vector2::new(1.0, 0.0); 9], 0, 5.0);
        assert_eq!(curve.closest(), Cpa { distance_m: 1.0, time_s: 10.0 });
    }

    #[test]
    fn the_future_comes_before_the_past() {
        let mut curve = DistanceCurve::new(0);
        curve.fill(STILL, [1.0, 2.0, 1.0].map(|x| Vector2::new(x, 0.0)), 1, 5.0);
        assert_eq!(curve.closest().time_s, 5.0);
    }

    #[test]
    fn too_few_or_broken_positions_give_an_unknown_cpa() {
        let mut curve = DistanceCurve::new(10);
        for target in [vec![], vec![Vector2::zeros(); 20]] {
            curve.fill(STILL, target, 0, 5.0);
            assert!(curve.closest().distance_m.is_nan());
        }
        let mut broken = vec![Vector2::zeros(); 50];
        broken[49].x = f64::NAN;
        curve.fill(STILL, broken, 0, 5.0);
        assert!(curve.closest().distance_m.is_nan() && curve.closest().time_s.is_nan());
    }

    #[test]
    fn one_position_is_enough_without_smoothing() {
        let mut curve = DistanceCurve::new(0);
        curve.fill(STILL, [Vector2::new(0.0, 4.0)], 0, 5.0);
        assert_eq!(curve.closest(), Cpa { distance_m: 4.0, time_s: 0.0 });
    }

    proptest! {
        /// On straight motions without smoothing, half a step is all that sampling can miss.
        #[test]
        fn straight_motions_come_close_to_the_closed_form(
            p in (-2000.0..2000.0_f64, -2000.0..2000.0_f64),
            v in (-5.0..5.0_f64, -5.0..5.0_f64),
            w in (-5.0..5.0_f64, -5.0..5.0_f64),
        ) {
            let (p, v, w) = (Vector2::new(p.0, p.1), Vector2::new(v.0, v.1), Vector2::new(w.0, w.1));
            let own = StraightMotion { position: Vector2::zeros(), velocity: v };
            let exact = linear::closest_approach(own.position, v, p, w);
            prop_assume!(exact.time_s.abs() < 495.0);
            let mut curve = DistanceCurve::new(0);
            curve.fill(own, straight(p, w, 100, 201), 100, 5.0);
            let sampled = curve.closest();
            prop_assert!((sampled.time_s - exact.time_s).abs() <= 2.5 + 1e-6);
            prop_assert!(sampled.distance_m >= exact.distance_m - 1e-9);
            prop_assert!(sampled.distance_m <= exact.distance_m.hypot(2.5 * (w - v).norm()) + 1e-6);
        }
    }
}
