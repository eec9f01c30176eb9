//! What a coastal agent observes, from what own ship's sensors give: one builder for the environment and for
//! agents that sail elsewhere. The table of values is in [`super`].

use std::f64::consts::PI;

use super::CoastalConfig;
use crate::angle::Nautical;
use crate::cpa::Cpa;
use crate::geo::{Position, Velocity};

/// Own ship as sensed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensedOwn {
    /// Position.
    pub position: Position,
    /// Direction of the bow.
    pub heading: Nautical,
    /// Speed over ground, in metres per second.
    pub speed_mps: f64,
    /// Cross-track error, positive to port, in metres.
    pub cross_track_m: f64,
}

/// An obstacle as sensed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensedObstacle {
    /// Position.
    pub position: Position,
    /// Velocity over ground.
    pub velocity: Velocity,
    /// Estimate of the collision risk; the observation holds estimates where every obstacle has one.
    pub estimate: Option<Cpa>,
}

/// Writes the observation of `obstacles` from own ship: sorted by estimated DCPA where there are estimates, by
/// distance where there are none, ties to the lower index.
///
/// # Panics
///
/// When `observation` is not of the length that the obstacles need.
pub fn observe(
    config: &CoastalConfig,
    own: &SensedOwn,
    obstacles: &[SensedObstacle],
    observation: &mut [f32],
) {
    let distance_m = |obstacle: &SensedObstacle| obstacle.position.distance_m(own.position);
    let key = |obstacle: &SensedObstacle| match obstacle.estimate {
        Some(estimate) => estimate.distance_m,
        None => distance_m(obstacle),
    };
    let mut sorted: Vec<&SensedObstacle> = obstacles.iter().collect();
    // A stable sort: ties stay with the lower index.
    sorted.sort_by(|a, b| key(a).total_cmp(&key(b)));

    let mut values = Vec::with_capacity(observation.len());
    values.extend([own.speed_mps / config.speed_scale_mps, own.cross_track_m / config.cross_track_scale_m]);
    for obstacle in sorted {
        let bearing = (obstacle.position - own.position).bearing();
        values.extend([
            (distance_m(obstacle) - config.collision_distance_m) / config.distance_scale_m,
            bearing.turn_from(own.heading) / PI,
            obstacle.velocity.course().turn_from(own.heading) / PI,
            obstacle.velocity.speed_mps() / config.speed_scale_mps,
        ]);
        if let Some(estimate) = obstacle.estimate {
            values.extend([
                (estimate.distance_m - config.collision_distance_m) / config.dcpa_scale_m,
                estimate.time_s / config.tcpa_scale_s,
            ]);
        }
    }
    assert_eq!(
        values.len(),
        observation.len(),
        "{} obstacle(s) do not fill the observation",
        obstacles.len()
    );
    for (slot, value) in observation.iter_mut().zip(values) {
        *slot = value as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: SensedOwn = SensedOwn {
        position: Position { north_m: 1000.0, east_m: 0.0 },
        heading: Nautical::NORTH,
        speed_mps: 8.0,
        cross_track_m: -50.0,
    };

    fn obstacle(north_m: f64, east_m: f64, course_deg: f64, estimate: Option<(f64, f64)>) -> SensedObstacle {
        SensedObstacle {
            position: OWN.position + crate::geo::Displacement { north_m, east_m },
            velocity: Velocity::from_course(Nautical::from_degrees(course_deg), 6.0),
            estimate: estimate.map(|(distance_m, time_s)| Cpa { distance_m, time_s }),
        }
    }

    fn assert_near(observation: &[f32], expected: &[f64]) {
        assert_eq!(observation.len(), expected.len());
        for (value, expected) in observation.iter().zip(expected) {
            assert!((f64::from(*value) - expected).abs() < 1e-6, "{observation:?} is not {expected:?}");
        }
    }

    /// Every value by hand: distance 1500 m ahead on the reciprocal course, 600 m abeam to port.
    #[test]
    fn values_are_those_of_the_table() {
        let config = CoastalConfig::default();
        let ahead = obstacle(1500.0, 0.0, 180.0, Some((500.0, 80.0)));
        let abeam = obstacle(0.0, -600.0, 90.0, Some((100.0, -20.0)));
        let mut observation = vec![0.0; 14];
        observe(&config, &OWN, &[ahead, abeam], &mut observation);
        let near = [0.1, -0.5, 0.5, 1.2, -2.0, -0.2];
        let far = [0.4, 0.0, 1.0, 1.2, 2.0, 0.8];
        assert_near(&observation, &[&[1.6, -0.25][..], &near, &far].concat());
        assert_eq!(observation.len(), CoastalConfig { linear_obstacles: 1, ..config }.observation_len(true));
    }

    #[test]
    fn without_estimates_the_nearest_comes_first_and_ties_keep_their_order() {
        let config = CoastalConfig::default();
        let [far, near] = [obstacle(0.0, 900.0, 0.0, None), obstacle(-600.0, 0.0, 0.0, None)];
        let as_near = obstacle(600.0, 0.0, 45.0, None);
        let mut observation = vec![0.0; 14];
        observe(&config, &OWN, &[far, near, as_near], &mut observation);
        // Dead astern is +pi, on the one side of the wrap that belongs to it.
        assert_near(&observation, &[1.6, -0.25, 0.1, 1.0, 0.0, 1.2, 0.1, 0.0, 0.25, 1.2, 0.2, 0.5, 0.0, 1.2]);
    }

    #[test]
    fn angles_wrap_around_astern() {
        let config = CoastalConfig::default();
        let own = SensedOwn { heading: Nautical::from_degrees(350.0), ..OWN };
        let mut observation = vec![0.0; 6];
        for (bearing_deg, course_deg) in [(10.0, 169.0), (171.0, 171.0), (340.0, 10.0)] {
            let away = crate::geo::Displacement::towards(Nautical::from_degrees(bearing_deg), 600.0);
            let obstacle = obstacle(away.north_m, away.east_m, course_deg, None);
            observe(&config, &own, &[obstacle], &mut observation);
            let wrapped = |degrees: f64| {
                let turn = (degrees - 350.0).rem_euclid(360.0);
                if turn > 180.0 { turn - 360.0 } else { turn }
            };
            assert!(
                (f64::from(observation[3]) * 180.0 - wrapped(bearing_deg)).abs() < 1e-4,
                "{observation:?}"
            );
            assert!(
                (f64::from(observation[4]) * 180.0 - wrapped(course_deg)).abs() < 1e-4,
                "{observation:?}"
            );
        }
    }
}
