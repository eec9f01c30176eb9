//! Distance between convex polygons through their Minkowski difference.
//!
//! Polygons `A` and `B`, with `B`'s centre at `r` from `A`'s, are as far apart as the point `-r` is
//! from the polygon `D = {b - a}`. While neither turns, `D` stands still and `-r` moves in a straight
//! line, so that the least distance within a step is that between a segment and a polygon.
//! Polygons are counter-clockwise.

use nalgebra::Vector2;

use super::centres::Closest;

/// How far a point is from a convex polygon, and which way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Separation {
    /// Zero inside.
    pub distance_m: f64,
    /// Unit vector from the nearest point of the polygon; zero inside.
    pub direction: Vector2<f64>,
}

/// Writes `{b - a}` for two polygons into `difference`.
pub(super) fn difference(a: &[Vector2<f64>], b: &[Vector2<f64>], difference: &mut Vec<Vector2<f64>>) {
    difference.clear();
    // `-a` is `a` turned by half a circle, so its lowest corner is the highest of `a`.
    let mut i = extreme(a, |corner| corner);
    let mut j = extreme(b, |corner| -corner);
    let (mut left_a, mut left_b) = (a.len(), b.len());
    while left_a + left_b > 0 {
        difference.push(b[j] - a[i]);
        let next_i = if i + 1 == a.len() { 0 } else { i + 1 };
        let next_j = if j + 1 == b.len() { 0 } else { j + 1 };
        let edge_a = a[i] - a[next_i];
        let edge_b = b[next_j] - b[j];
        // Edges in order of direction; parallel ones become one.
        let turn = edge_a.perp(&edge_b);
        let take_a = left_a > 0 && (left_b == 0 || turn >= 0.0);
        let take_b = left_b > 0 && (left_a == 0 || turn <= 0.0);
        if take_a {
            i = next_i;
            left_a -= 1;
        }
        if take_b {
            j = next_j;
            left_b -= 1;
        }
    }
}

/// The corner highest in `key(corner)`: largest y, and of those the largest x.
fn extreme(corners: &[Vector2<f64>], key: impl Fn(Vector2<f64>) -> Vector2<f64>) -> usize {
    let mut best = 0;
    let mut best_key = key(corners[0]);
    for (index, corner) in corners.iter().enumerate().skip(1) {
        let candidate = key(*corner);
        if (candidate.y, candidate.x) > (best_key.y, best_key.x) {
            (best, best_key) = (index, candidate);
        }
    }
    best
}

/// How far `point` is from a polygon.
pub(super) fn separation(polygon: &[Vector2<f64>], point: Vector2<f64>) -> Separation {
    let mut inside = true;
    let mut nearest = Vector2::zeros();
    let mut least = f64::INFINITY;
    for_each_edge(polygon, |corner, edge| {
        let from_corner = point - corner;
        inside &= edge.perp(&from_corner) >= 0.0;
        let along = (from_corner.dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
        let offset = from_corner - edge * along;
        let squared = offset.norm_squared();
        if squared < least {
            (least, nearest) = (squared, offset);
        }
    });
    let distance_m = least.sqrt();
    if inside || distance_m == 0.0 {
        return Separation { distance_m: 0.0, direction: Vector2::zeros() };
    }
    Separation { distance_m, direction: nearest / distance_m }
}

/// When a point that moves evenly from `from` to `to` is nearest to a polygon; where it gets inside,
/// the moment it enters.
pub(super) fn closest_on_way(polygon: &[Vector2<f64>], from: Vector2<f64>, to: Vector2<f64>) -> Closest {
    if let Some(fraction) = entry(polygon, from, to) {
        return Closest { distance_m: 0.0, fraction };
    }
    let way = to - from;
    let way_squared = way.norm_squared();
    let mut closest = Closest { distance_m: f64::INFINITY, fraction: 0.0 };
    let mut offer = |squared: f64, fraction: f64| {
        if squared < closest.distance_m {
            closest = Closest { distance_m: squared, fraction };
        }
    };
    // Segments that do not cross are nearest at an end of one of them.
    for_each_edge(polygon, |corner, edge| {
        let edge_squared = edge.norm_squared();
        for (point, fraction) in [(from, 0.0), (to, 1.0)] {
            let along = ((point - corner).dot(&edge) / edge_squared).clamp(0.0, 1.0);
            offer((point - corner - edge * along).norm_squared(), fraction);
        }
        if way_squared > 0.0 {
            let fraction = ((corner - from).dot(&way) / way_squared).clamp(0.0, 1.0);
            offer((from + way * fraction - corner).norm_squared(), fraction);
        }
    });
    Closest { distance_m: closest.distance_m.sqrt(), ..closest }
}

/// The fraction of the way from `from` to `to` at which a point enters a polygon (Cyrus and Beck's
/// clipping); zero where it starts inside.
fn entry(polygon: &[Vector2<f64>], from: Vector2<f64>, to: Vector2<f64>) -> Option<f64> {
    let way = to - from;
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for_each_edge(polygon, |corner, edge| {
        // Inside is where `height + rate s >= 0`.
        let height = edge.perp(&(from - corner));
        let rate = edge.perp(&way);
        if rate > 0.0 {
            enter = enter.max(-height / rate);
        } else if rate < 0.0 {
            leave = leave.min(-height / rate);
        } else if height < 0.0 {
            leave = f64::NEG_INFINITY;
        }
    });
    (enter <= leave).then_some(enter)
}

fn for_each_edge(polygon: &[Vector2<f64>], mut visit: impl FnMut(Vector2<f64>, Vector2<f64>)) {
    let mut corner = polygon[polygon.len() - 1];
    for &next in polygon {
        visit(corner, next - corner);
        corner = next;
    }
}

#[cfg(test)]
mod tests {
    use parry2d_f64::math::{Pose, Vector};
    use parry2d_f64::query;
    use parry2d_f64::shape::ConvexPolygon;
    use proptest::prelude::*;

    use super::*;

    fn square(half: f64) -> Vec<Vector2<f64>> {
        [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, y)| Vector2::new(x, y)).to_vec()
    }

    /// Corners on an ellipse at increasing angles: convex and counter-clockwise.
    fn polygon() -> impl Strategy<Value = Vec<Vector2<f64>>> {
        (3..9_usize, 5.0..80.0_f64, 5.0..40.0_f64, 0.0..6.3_f64).prop_map(|(corners, a, b, turn)| {
            let angle = |k: usize| std::f64::consts::TAU * k as f64 / corners as f64;
            let rotation = nalgebra::Rotation2::new(turn);
            (0..corners).map(|k| rotation * Vector2::new(a * angle(k).cos(), b * angle(k).sin())).collect()
        })
    }

    fn parry(corners: &[Vector2<f64>]) -> ConvexPolygon {
        ConvexPolygon::from_convex_hull(&corners.iter().map(|c| Vector::new(c.x, c.y)).collect::<Vec<_>>())
            .expect("a convex polygon")
    }

    #[test]
    fn two_squares_differ_by_a_square() {
        let mut sum = Vec::new();
        difference(&square(1.0), &square(2.0), &mut sum);
        assert_eq!(sum.len(), 4);
        assert!(sum.iter().all(|corner| corner.x.abs() == 3.0 && corner.y.abs() == 3.0));
    }

    #[test]
    fn a_point_that_flies_through_is_seen_to_enter() {
        let closest = closest_on_way(&square(1.0), Vector2::new(-5.0, 0.5), Vector2::new(5.0, 0.5));
        assert_eq!(closest, Closest { distance_m: 0.0, fraction: 0.4 });
        let past = closest_on_way(&square(1.0), Vector2::new(-5.0, 1.5), Vector2::new(5.0, 1.5));
        assert_eq!(past.distance_m, 0.5);
        assert!((0.4..=0.6).contains(&past.fraction));
    }

    proptest! {
        #[test]
        fn distances_agree_with_parry(
            a in polygon(), b in polygon(), x in -200.0..200.0_f64, y in -200.0..200.0_f64,
        ) {
            let mut shape = Vec::new();
            difference(&a, &b, &mut shape);
            let ours = separation(&shape, -Vector2::new(x, y));
            let theirs = query::distance(
                &Pose::identity(), &parry(&a), &Pose::translation(x, y), &parry(&b),
            ).expect("supported shapes").distance;
            prop_assert!((ours.distance_m - theirs).abs() < 1e-6, "{} against {theirs}", ours.distance_m);
        }

        #[test]
        fn the_least_distance_on_a_way_is_that_of_dense_sampling(
            a in polygon(), b in polygon(),
            from in (-200.0..200.0_f64, -200.0..200.0_f64), to in (-200.0..200.0_f64, -200.0..200.0_f64),
        ) {
            let mut shape = Vec::new();
            difference(&a, &b, &mut shape);
            let (from, to) = (Vector2::new(from.0, from.1), Vector2::new(to.0, to.1));
            let closest = closest_on_way(&shape, from, to);
            let at = |fraction: f64| separation(&shape, from + (to - from) * fraction).distance_m;
            prop_assert!((at(closest.fraction) - closest.distance_m).abs() < 1e-9);
            for k in 0..=500 {
                let fraction = f64::from(k) / 500.0;
                prop_assert!(at(fraction) >= closest.distance_m - 1e-9);
                prop_assert!(at(fraction) > 0.0 || closest.fraction <= fraction + 1e-12);
            }
        }
    }
}
