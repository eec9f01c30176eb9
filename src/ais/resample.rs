//! Resampling: a smooth path through a trajectory's fixes, read off on a uniform time grid.
//!
//! The path is a piecewise cubic in Hermite form: between two fixes it is given by their positions
//! and the velocities assigned to them. With the velocities of the natural cubic spline it is twice
//! continuously differentiable, but may swing out where fixes are far apart. On intervals where
//! it is faster or bows out farther than the fixes around imply, the velocities at both ends are those of the
//! shape-preserving cubic (Fritsch & Butland 1984), and should even that be too fast, the path is
//! straight there.

use super::clean::Fix;
use super::config::ImportConfig;
use crate::geo::{Displacement, Position, Velocity};

/// A path through fixes.
#[derive(Debug, Clone)]
pub struct Path {
    /// Times of the fixes in seconds after the first.
    times_s: Vec<f64>,
    positions: Vec<Position>,
    velocities: Vec<Velocity>,
    /// How each interval between two fixes is bridged.
    pub intervals: Vec<Interval>,
}

/// How the path bridges the interval between two fixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interval {
    /// By the cubic spline.
    Spline,
    /// By the shape-preserving cubic.
    ShapePreserving,
    /// By a straight line.
    Straight,
}

impl Path {
    /// The path through a trajectory of two fixes at least, in order of time without repetition.
    pub fn through(fixes: &[Fix], config: &ImportConfig) -> Self {
        let times_s: Vec<f64> = fixes.iter().map(|fix| fix.seconds_since(&fixes[0])).collect();
        let positions: Vec<Position> = fixes.iter().map(|fix| fix.position).collect();
        let legs = Legs::between(&times_s, &positions);
        let (spline, preserving) = (legs.spline_velocities(), legs.shape_preserving_velocities());

        let mut velocities = spline;
        let mut preserved = vec![false; positions.len()];
        // Each round only adds to the preserved fixes, so this ends.
        loop {
            let swinging: Vec<usize> = (0..legs.chords.len())
                .filter(|&leg| !(preserved[leg] && preserved[leg + 1]))
                .filter(|&leg| legs.swings_out(leg, &velocities, config))
                .collect();
            if swinging.is_empty() {
                break;
            }
            for end in swinging.into_iter().flat_map(|leg| [leg, leg + 1]) {
                (preserved[end], velocities[end]) = (true, preserving[end]);
            }
        }
        let intervals = (0..legs.chords.len())
            .map(|leg| match preserved[leg] && preserved[leg + 1] {
                _ if legs.speed_bound_mps(leg, &velocities) > config.max_speed_mps => Interval::Straight,
                true => Interval::ShapePreserving,
                false => Interval::Spline,
            })
            .collect();
        Self { times_s, positions, velocities, intervals }
    }

    /// Where the path is `time_s` after its first fix; held at either end.
    pub fn position_at(&self, time_s: f64) -> Position {
        let last_leg = self.intervals.len() - 1;
        let leg = self.times_s.partition_point(|&fix_s| fix_s <= time_s).saturating_sub(1).min(last_leg);
        let duration_s = self.times_s[leg + 1] - self.times_s[leg];
        let fraction = ((time_s - self.times_s[leg]) / duration_s).clamp(0.0, 1.0);
        let (from, to) = (self.positions[leg], self.positions[leg + 1]);
        if self.intervals[leg] == Interval::Straight {
            return from.lerp(to, fraction);
        }
        // Bezier form: the control points lie a third of the way along the end velocities.
        let after_from = from + self.velocities[leg].for_seconds(duration_s / 3.0);
        let before_to = to - self.velocities[leg + 1].for_seconds(duration_s / 3.0);
        let (a, b, c) = (
            from.lerp(after_from, fraction),
            after_from.lerp(before_to, fraction),
            before_to.lerp(to, fraction),
        );
        a.lerp(b, fraction).lerp(b.lerp(c, fraction), fraction)
    }

    /// The path on a time grid: position `k` is at `first_s + k dt_s`, as long as there is path.
    pub fn sampled(&self, first_s: f64, dt_s: f64) -> Vec<Position> {
        let last_s = self.times_s[self.times_s.len() - 1];
        let steps = ((last_s - first_s) / dt_s + 1e-9).floor();
        if steps < 0.0 {
            return Vec::new();
        }
        (0..=steps as usize).map(|k| self.position_at(first_s + k as f64 * dt_s)).collect()
    }
}

/// The straight legs between fixes.
struct Legs {
    durations_s: Vec<f64>,
    chords: Vec<Velocity>,
}

impl Legs {
    fn between(times_s: &[f64], positions: &[Position]) -> Self {
        let durations_s: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let chords =
            positions.windows(2).zip(&durations_s).map(|(pair, &s)| (pair[1] - pair[0]).per_seconds(s));
        Self { chords: chords.collect(), durations_s }
    }

    /// Velocities at the fixes that make the path a natural cubic spline: the tridiagonal system
    /// of continuous accelerations, solved by elimination (it is diagonally dominant).
    fn spline_velocities(&self) -> Vec<Velocity> {
        let legs = self.chords.len();
        let row = |fix: usize| -> (f64, f64, f64, Velocity) {
            if fix == 0 {
                return (0.0, 2.0, 1.0, times(self.chords[0], 3.0));
            }
            if fix == legs {
                return (1.0, 2.0, 0.0, times(self.chords[legs - 1], 3.0));
            }
            let (before_s, after_s) = (self.durations_s[fix - 1], self.durations_s[fix]);
            let right = times(self.chords[fix - 1], 3.0 * after_s) + times(self.chords[fix], 3.0 * before_s);
            (after_s, 2.0 * (before_s + after_s), before_s, right)
        };
        let mut upper = Vec::with_capacity(legs + 1);
        let mut reduced: Vec<Velocity> = Vec::with_capacity(legs + 1);
        for fix in 0..=legs {
            let (below, diagonal, above, right) = row(fix);
            let (above_before, right_before) = fix
                .checked_sub(1)
                .map_or((0.0, Velocity::default()), |before| (upper[before], reduced[before]));
            let pivot = diagonal - below * above_before;
            upper.push(above / pivot);
            reduced.push(times(right - times(right_before, below), 1.0 / pivot));
        }
        for fix in (0..legs).rev() {
            reduced[fix] = reduced[fix] - times(reduced[fix + 1], upper[fix]);
        }
        reduced
    }

    /// Velocities at the fixes for which each coordinate is monotone between two fixes: a weighted
    /// harmonic mean of the chords on either side, zero where they disagree in sign.
    fn shape_preserving_velocities(&self) -> Vec<Velocity> {
        let legs = self.chords.len();
        (0..=legs)
            .map(|fix| {
                if fix == 0 || fix == legs {
                    return self.chords[fix.min(legs - 1)];
                }
                let (before_s, after_s) = (self.durations_s[fix - 1], self.durations_s[fix]);
                let weights = (before_s + 2.0 * after_s, 2.0 * before_s + after_s);
                let (before, after) = (self.chords[fix - 1], self.chords[fix]);
                Velocity {
                    north_mps: harmonic_mean(before.north_mps, after.north_mps, weights),
                    east_mps: harmonic_mean(before.east_mps, after.east_mps, weights),
                }
            })
            .collect()
    }

    /// No speed on the leg exceeds this: the velocity is a quadratic Bezier curve and stays within
    /// the hull of its control points.
    fn speed_bound_mps(&self, leg: usize, velocities: &[Velocity]) -> f64 {
        let (from, to) = (velocities[leg], velocities[leg + 1]);
        let middle = times(self.chords[leg], 3.0) - from - to;
        from.speed_mps().max(middle.speed_mps()).max(to.speed_mps())
    }

    /// Whether the path on a leg is faster than the fixes around it let expect, or bows out too
    /// far from the straight line.
    fn swings_out(&self, leg: usize, velocities: &[Velocity], config: &ImportConfig) -> bool {
        let (chord, duration_s) = (self.chords[leg], self.durations_s[leg]);
        // A Bezier curve stays within the hull of its control points, and these lie this far from
        // where a straight and steady motion has them.
        let bow_m = [leg, leg + 1].map(|end| (velocities[end] - chord).speed_mps() * duration_s / 3.0);
        let allowed_m = config.spline_bow_factor * chord.speed_mps() * duration_s + config.spline_bow_slack_m;
        self.speed_bound_mps(leg, velocities) > self.plausible_mps(leg, config)
            || bow_m.into_iter().any(|bow_m| bow_m > allowed_m)
    }

    /// What the fixes around a leg let expect of the speed on it.
    fn plausible_mps(&self, leg: usize, config: &ImportConfig) -> f64 {
        let around = &self.chords[leg.saturating_sub(1)..(leg + 2).min(self.chords.len())];
        let fastest = around.iter().map(|chord| chord.speed_mps()).fold(0.0, f64::max);
        (config.spline_speed_factor * fastest + config.spline_speed_floor_mps).min(config.max_speed_mps)
    }
}

fn times(velocity: Velocity, factor: f64) -> Velocity {
    let Displacement { north_m, east_m } = velocity.for_seconds(factor);
    Velocity { north_mps: north_m, east_mps: east_m }
}

fn harmonic_mean(before: f64, after: f64, (weight_before, weight_after): (f64, f64)) -> f64 {
    if before * after <= 0.0 {
        return 0.0;
    }
    (weight_before + weight_after) / (weight_before / before + weight_after / after)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn fix(seconds: f64, north_m: f64, east_m: f64) -> Fix {
        let unix_ms = (seconds * 1000.0).round() as i64;
        Fix { unix_ms, position: Position { north_m, east_m }, sog_mps: None, cog: None }
    }

    /// A circle of 500 m radius at 5 m/s, a fix every `every_s`.
    fn circle(every_s: f64) -> Vec<Fix> {
        (0..20)
            .map(|k| {
                let time_s = every_s * f64::from(k);
                fix(time_s, 500.0 * (time_s / 100.0).cos(), 500.0 * (time_s / 100.0).sin())
            })
            .collect()
    }

    #[test]
    fn a_turn_is_rounded_as_the_vessel_went() {
        let path = Path::through(&circle(20.0), &ImportConfig::default());
        assert!(path.intervals.iter().all(|&interval| interval == Interval::Spline));
        // The natural end bends too little; inside the spline follows the circle.
        for step in 10..65 {
            let radius_m = path.position_at(5.0 * f64::from(step)).distance_m(Position::ORIGIN);
            assert!((radius_m - 500.0).abs() < 0.1, "{radius_m}");
        }
    }

    #[test]
    fn a_stop_before_a_long_gap_does_not_swing_out() {
        // Under way, then at rest across a gap: a plain spline would sail on and come back.
        let mut fixes: Vec<Fix> =
            (0..10).map(|k| fix(10.0 * f64::from(k), 80.0 * f64::from(k), 0.0)).collect();
        fixes.extend((0..4).map(|k| fix(100.0 + 360.0 * f64::from(k), 725.0, 0.0)));
        let path = Path::through(&fixes, &ImportConfig::default());
        assert!(path.intervals.contains(&Interval::ShapePreserving));
        for position in path.sampled(0.0, 5.0) {
            assert!((-0.001..725.5).contains(&position.north_m), "{position:?}");
        }
    }

    #[test]
    fn the_spline_solves_its_system() {
        // A cubic's velocities come back where the natural end condition holds for it.
        let fixes: Vec<Fix> = [0.0, 7.0, 10.0, 30.0, 31.0].map(|t: f64| fix(t, 2.0 * t, -3.0 * t)).to_vec();
        let path = Path::through(&fixes, &ImportConfig::default());
        for velocity in &path.velocities {
            assert!((velocity.north_mps - 2.0).abs() < 1e-12 && (velocity.east_mps + 3.0).abs() < 1e-12);
        }
    }

    fn voyages() -> impl Strategy<Value = Vec<Fix>> {
        // Legs within the cap, at all angles and of very different durations.
        let leg = (1.0..371.0_f64, 0.0..29.9_f64, 0.0..std::f64::consts::TAU);
        proptest::collection::vec(leg, 1..40).prop_map(|legs| {
            let mut fixes = vec![fix(0.0, 0.0, 0.0)];
            for (duration_s, speed, direction) in legs {
                let last = fixes[fixes.len() - 1];
                let milliseconds = (duration_s * 1000.0).round();
                let way = speed * milliseconds / 1000.0;
                let position = last.position
                    + Displacement { north_m: way * direction.cos(), east_m: way * direction.sin() };
                fixes.push(Fix { unix_ms: last.unix_ms + milliseconds as i64, position, ..last });
            }
            fixes
        })
    }

    proptest! {
        #[test]
        fn the_path_passes_within_1_mm_of_every_fix(fixes in voyages()) {
            let path = Path::through(&fixes, &ImportConfig::default());
            for fix in &fixes {
                let miss_m = path.position_at(fix.seconds_since(&fixes[0])).distance_m(fix.position);
                prop_assert!(miss_m < 0.001, "{miss_m} m");
            }
        }

        #[test]
        fn no_implied_speed_is_above_the_cap(fixes in voyages(), first_s in 0.0..5.0_f64) {
            let config = ImportConfig::default();
            let samples = Path::through(&fixes, &config).sampled(first_s, 5.0);
            for pair in samples.windows(2) {
                prop_assert!(pair[0].distance_m(pair[1]) / 5.0 <= config.max_speed_mps + 1e-9);
            }
        }

        #[test]
        fn the_path_has_no_breaks(fixes in voyages()) {
            let config = ImportConfig::default();
            let path = Path::through(&fixes, &config);
            for fix in &fixes[1..] {
                let time_s = fix.seconds_since(&fixes[0]);
                let (before, after) = (path.position_at(time_s - 1e-6), path.position_at(time_s + 1e-6));
                prop_assert!(before.distance_m(after) < 1e-3);
            }
        }
    }
}
