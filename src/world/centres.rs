//! Two centres within one step: their distance is the norm of an affine function of time.

use nalgebra::Vector2;

/// A least distance and the fraction of the step, in `[0, 1]`, at which it is reached first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Closest {
    pub distance_m: f64,
    pub fraction: f64,
}

/// The second centre as seen from the first, from the beginning of a step to its end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Approach {
    pub before: Vector2<f64>,
    pub after: Vector2<f64>,
}

impl Approach {
    pub fn new(before: Vector2<f64>, after: Vector2<f64>) -> Self {
        Self { before, after }
    }

    pub fn at(&self, fraction: f64) -> Vector2<f64> {
        self.before + (self.after - self.before) * fraction
    }

    /// The least distance: at `-a.b / b.b` of the step for `|a + b s|`, or at its nearer end.
    pub fn closest(&self) -> Closest {
        let way = self.after - self.before;
        let length_squared = way.norm_squared();
        let fraction = if length_squared > 0.0 {
            (-self.before.dot(&way) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        Closest { distance_m: self.at(fraction).norm(), fraction }
    }

    /// The first fraction of the step at which the distance is no more than `radius_m`.
    pub fn first_within(&self, radius_m: f64) -> Option<f64> {
        if self.before.norm() <= radius_m {
            return Some(0.0);
        }
        let closest = self.closest();
        if closest.distance_m > radius_m {
            return None;
        }
        // Half a chord back from the foot of the perpendicular, which the closest point is unless
        // the step ends on the way there.
        let way = self.after - self.before;
        let foot = -self.before.dot(&way) / way.norm_squared();
        let offset_squared = self.at(foot).norm_squared();
        let half_chord = ((radius_m * radius_m - offset_squared).max(0.0) / way.norm_squared()).sqrt();
        Some((foot - half_chord).clamp(0.0, closest.fraction))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_passage_between_two_samples_is_seen() {
        let approach = Approach::new(Vector2::new(-400.0, 100.0), Vector2::new(400.0, 100.0));
        assert_eq!(approach.closest(), Closest { distance_m: 100.0, fraction: 0.5 });
        let entry = approach.first_within(125.0).expect("within 125 m");
        assert!((approach.at(entry).norm() - 125.0).abs() < 1e-9 && entry < 0.5);
        assert_eq!(approach.first_within(99.0), None);
    }

    #[test]
    fn the_circle_itself_is_contact() {
        let still = Approach::new(Vector2::new(300.0, 0.0), Vector2::new(300.0, 0.0));
        assert_eq!(still.first_within(300.0), Some(0.0));
        assert_eq!(still.closest(), Closest { distance_m: 300.0, fraction: 0.0 });
    }

    proptest! {
        #[test]
        fn dense_sampling_finds_nothing_closer_and_nothing_earlier(
            a in (-300.0..300.0_f64, -300.0..300.0_f64),
            b in (-300.0..300.0_f64, -300.0..300.0_f64),
            radius_m in 1.0..300.0_f64,
        ) {
            let approach = Approach::new(Vector2::new(a.0, a.1), Vector2::new(b.0, b.1));
            let closest = approach.closest();
            let entry = approach.first_within(radius_m);
            prop_assert_eq!(entry.is_some(), closest.distance_m <= radius_m);
            for k in 0..=1000 {
                let fraction = f64::from(k) / 1000.0;
                let distance = approach.at(fraction).norm();
                prop_assert!(distance >= closest.distance_m - 1e-9);
                prop_assert!(distance >= radius_m - 1e-9 || entry.is_some_and(|entry| entry <= fraction));
            }
        }
    }
}
