//! The closed form for two straight motions (Lenart 1983, Collision threat parameters for a new
//! radar display and plot technique; the paper's section on collision risk estimation).

use nalgebra::Vector2;

use super::Cpa;

/// The CPA of two vessels that both keep their velocity, over all time.
///
/// With equal velocities every distance is the present one, and the time is 0. A value that is not
/// finite in any argument gives [`Cpa::UNKNOWN`].
///
/// `p_*` are positions in metres, `v_*` velocities in metres per second.
#[must_use]
pub fn closest_approach(
    p_own: Vector2<f64>,
    v_own: Vector2<f64>,
    p_target: Vector2<f64>,
    v_target: Vector2<f64>,
) -> Cpa {
    let p = p_target - p_own;
    let v = v_target - v_own;
    let speed_mps = v.x.hypot(v.y);
    if !(p.x.is_finite() && p.y.is_finite() && speed_mps.is_finite()) {
        return Cpa::UNKNOWN;
    }
    // Along and across the relative velocity: the cross product keeps the distance exact where
    // `|p + v t|` would cancel.
    let direction = v / speed_mps;
    let time_s = -p.dot(&direction) / speed_mps;
    if speed_mps == 0.0 || !time_s.is_finite() {
        return Cpa { distance_m: p.x.hypot(p.y), time_s: 0.0 };
    }
    Cpa { distance_m: p.perp(&direction).abs(), time_s }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn vector() -> impl Strategy<Value = Vector2<f64>> {
        (-2000.0..2000.0_f64, -2000.0..2000.0_f64).prop_map(|(x, y)| Vector2::new(x, y))
    }

    fn velocity() -> impl Strategy<Value = Vector2<f64>> {
        vector().prop_map(|v| v / 200.0)
    }

    #[test]
    fn a_head_on_target_meets_at_half_the_way() {
        let cpa = closest_approach(
            Vector2::new(0.0, 0.0),
            Vector2::new(0.0, 8.0),
            Vector2::new(30.0, 2400.0),
            Vector2::new(0.0, -4.0),
        );
        assert!((cpa.time_s - 200.0).abs() < 1e-12 && (cpa.distance_m - 30.0).abs() < 1e-12);
    }

    #[test]
    fn a_target_that_has_passed_has_a_negative_time() {
        let cpa = closest_approach(
            Vector2::new(0.0, 0.0),
            Vector2::new(5.0, 0.0),
            Vector2::new(-100.0, 40.0),
            Vector2::new(0.0, 0.0),
        );
        assert_eq!(cpa, Cpa { distance_m: 40.0, time_s: -20.0 });
    }

    #[test]
    fn equal_velocities_keep_the_present_distance() {
        let v = Vector2::new(3.0, -1.0);
        let cpa = closest_approach(Vector2::new(1.0, 2.0), v, Vector2::new(4.0, 6.0), v);
        assert_eq!(cpa, Cpa { distance_m: 5.0, time_s: 0.0 });
        let same = closest_approach(Vector2::zeros(), v, Vector2::zeros(), v);
        assert_eq!(same, Cpa { distance_m: 0.0, time_s: 0.0 });
    }

    #[test]
    fn a_velocity_difference_below_the_range_of_floats_counts_as_equal() {
        let v = Vector2::new(1e-320, 0.0);
        let cpa = closest_approach(Vector2::zeros(), v, Vector2::new(0.0, 7.0), Vector2::zeros());
        assert!(cpa.is_finite() && (cpa.distance_m - 7.0).abs() < 1e-12, "{cpa:?}");
    }

    #[test]
    fn what_is_not_finite_gives_an_unknown_cpa() {
        let bad = Vector2::new(f64::NAN, 0.0);
        let zero = Vector2::zeros();
        for cpa in [
            closest_approach(bad, zero, zero, zero),
            closest_approach(zero, zero, zero, bad),
            closest_approach(zero, Vector2::new(f64::INFINITY, 0.0), zero, zero),
        ] {
            assert!(cpa.distance_m.is_nan() && cpa.time_s.is_nan());
        }
    }

    proptest! {
        #[test]
        fn no_time_is_closer(p in vector(), q in vector(), v in velocity(), w in velocity(), t in -500.0..500.0_f64) {
            let cpa = closest_approach(p, v, q, w);
            let distance_at = |t: f64| (q + w * t - p - v * t).norm();
            prop_assert!(distance_at(cpa.time_s + t) >= cpa.distance_m - 1e-9);
            let scale = 1.0 + (q - p).norm();
            prop_assert!((distance_at(cpa.time_s) - cpa.distance_m).abs() <= 1e-9 * scale);
        }

        #[test]
        fn swapping_the_vessels_changes_nothing(p in vector(), q in vector(), v in velocity(), w in velocity()) {
            prop_assert_eq!(closest_approach(p, v, q, w), closest_approach(q, w, p, v));
        }
    }
}
