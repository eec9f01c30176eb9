//! The vessels of one episode: own ship and the recorded one head-on, further traffic around them.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::CoastalConfig;
use crate::angle::Nautical;
use crate::cpa::linear::closest_approach;
use crate::geo::{Displacement, Position, Velocity};
use crate::scenario::encounter_starts::{HeadOnKind, HeadOnPose, HeadOnStart, HeadOnStarts, head_on_pose};
use crate::vessel::Linear;

/// How an episode starts.
#[derive(Debug, Clone)]
pub struct Opening {
    /// The scenario.
    pub kind: HeadOnKind,
    /// The track and where on it the recorded vessel starts.
    pub start: HeadOnStart,
    /// Own ship's undisturbed start; cross-track errors refer to the path from it.
    pub path: HeadOnPose,
    /// Own ship's actual position.
    pub own_position: Position,
    /// Own ship's actual heading.
    pub own_heading: Nautical,
    /// How own ship came there: straight on.
    pub own_before: Linear,
    /// The vessels that move in straight lines.
    pub linear: Vec<Linear>,
}

impl Opening {
    /// Draws an episode. `state_of` gives position and velocity of the recorded vessel at a start.
    ///
    /// `None` where a scenario that is asked for has no start.
    pub fn draw(
        config: &CoastalConfig,
        starts: &HeadOnStarts,
        dt_s: f64,
        state_of: impl Fn(HeadOnStart) -> (Position, Velocity),
        rng: &mut ChaCha8Rng,
    ) -> Option<Self> {
        let kinds = config.scenario.kinds();
        let kind = kinds[rng.random_range(0..kinds.len())];
        let start = starts.draw(kind, rng)?;
        let (position, velocity) = state_of(start);
        let head_on = &config.head_on;
        let path = head_on_pose(position, velocity, head_on.own_speed_mps, head_on.time_to_collision_s);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let disturbance = Displacement { north_m: normal(), east_m: normal() } * config.start_position_sd_m;
        let own_position = path.position + disturbance;
        let to_port_deg = rng.random_range(0.0..=config.start_heading_port_deg);
        let own_heading = path.course.turned(-to_port_deg.to_radians());
        let own_velocity = Velocity::from_course(own_heading, head_on.own_speed_mps);
        let linear = (0..config.linear_obstacles)
            .map(|_| {
                let (position, velocity) = if rng.random() {
                    draw_following(config, own_position, own_heading, rng)
                } else {
                    draw_other(config, own_position, own_velocity, rng)
                };
                Linear::new(position, velocity, dt_s)
            })
            .collect();
        let own_before = Linear::new(own_position, own_velocity, dt_s);
        Some(Self { kind, start, path, own_position, own_heading, own_before, linear })
    }
}

fn draw_speed_mps(config: &CoastalConfig, rng: &mut ChaCha8Rng) -> f64 {
    config.head_on.own_speed_mps + config.linear_speed_sd_mps * rng.sample::<f64, _>(StandardNormal)
}

/// Following traffic: a course near own ship's, and some way back along that course.
fn draw_following(
    config: &CoastalConfig,
    own: Position,
    own_heading: Nautical,
    rng: &mut ChaCha8Rng,
) -> (Position, Velocity) {
    let speed_mps = draw_speed_mps(config, rng);
    let aside_deg = rng.random_range(-config.following_course_deg..=config.following_course_deg);
    let course = own_heading.turned(aside_deg.to_radians());
    let back_m = rng.random_range(config.following_back_min_m..=config.following_back_max_m);
    (own - Displacement::towards(course, back_m), Velocity::from_course(course, speed_mps))
}

/// Other traffic: anywhere around, on any course that keeps well clear.
fn draw_other(
    config: &CoastalConfig,
    own: Position,
    own_velocity: Velocity,
    rng: &mut ChaCha8Rng,
) -> (Position, Velocity) {
    let speed_mps = draw_speed_mps(config, rng);
    let mut offset_m = || {
        let offset_m = rng.random_range(config.other_offset_min_m..=config.other_offset_max_m);
        if rng.random() { offset_m } else { -offset_m }
    };
    let position = own + Displacement { north_m: offset_m(), east_m: offset_m() };
    // From this far off most courses pass well clear, so that this ends soon.
    loop {
        let course = Nautical::from_degrees(rng.random_range(0.0..360.0));
        let velocity = Velocity::from_course(course, speed_mps);
        let cpa = closest_approach(own.xy(), own_velocity.xy(), position.xy(), velocity.xy());
        if cpa.distance_m >= config.other_dcpa_min_m {
            return (position, velocity);
        }
    }
}

/// Sensor noise of an episode: one standard normal draw on north and on east per vessel and time step,
/// drawn beforehand so that it does not depend on what the policy does.
#[derive(Debug, Clone)]
pub struct SensorNoise {
    draws: Vec<Displacement>,
    vessels: usize,
    history: usize,
}

impl SensorNoise {
    /// Draws for `vessels` over `history` steps before the start and `steps` after it.
    #[must_use]
    pub fn draw(seed: u64, vessels: usize, history: usize, steps: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // A stream of its own: the episode itself is drawn from stream 0 of the same seed.
        rng.set_stream(1);
        let draws = (0..vessels * (history + steps + 1))
            .map(|_| Displacement { north_m: rng.sample(StandardNormal), east_m: rng.sample(StandardNormal) })
            .collect();
        Self { draws, vessels, history }
    }

    /// The error of a vessel's position at a step, for a standard deviation of one metre.
    #[must_use]
    pub fn at(&self, vessel: usize, step: i64) -> Displacement {
        let row = (step + self.history as i64) as usize;
        self.draws[row * self.vessels + vessel]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWS: u64 = 6000;

    fn assert_near(value: f64, expected: f64, tolerance: f64, what: &str) {
        assert!((value - expected).abs() < tolerance, "{what}: {value} is not {expected}");
    }

    /// Mean and variance of what is drawn.
    fn moments(mut draw: impl FnMut(&mut ChaCha8Rng) -> f64) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let values: Vec<f64> = (0..DRAWS).map(|_| draw(&mut rng)).collect();
        let mean = values.iter().sum::<f64>() / DRAWS as f64;
        (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / DRAWS as f64)
    }

    const OWN: Position = Position { north_m: 300.0, east_m: -200.0 };

    fn heading() -> Nautical {
        Nautical::from_degrees(350.0)
    }

    #[test]
    fn following_traffic_is_placed_by_its_formulas() {
        let config = CoastalConfig::default();
        let following = |rng: &mut ChaCha8Rng| draw_following(&config, OWN, heading(), rng);
        let (mean, variance) = moments(|rng| following(rng).1.speed_mps());
        assert_near(mean, 8.0, 0.01, "mean speed");
        assert_near(variance.sqrt(), 0.2, 0.006, "spread of the speed");
        let (mean, variance) = moments(|rng| following(rng).1.course().turn_from(heading()).to_degrees());
        assert_near(mean, 0.0, 0.8, "mean course, U(-30, 30) degrees");
        assert_near(variance, 300.0, 10.0, "its variance, 60^2 / 12");
        let (mean, variance) = moments(|rng| following(rng).0.distance_m(OWN));
        assert_near(mean, 750.0, 7.0, "mean distance, U(500, 1000) m");
        assert_near(variance, 500.0 * 500.0 / 12.0, 700.0, "its variance");
        let (mean, variance) = moments(|rng| {
            let (position, velocity) = following(rng);
            (OWN - position).bearing().turn_from(velocity.course())
        });
        assert!(mean.abs() < 1e-9 && variance < 1e-18, "own ship lies right ahead on its course");
    }

    #[test]
    fn other_traffic_is_placed_by_its_formulas() {
        let config = CoastalConfig::default();
        let own_velocity = Velocity::from_course(heading(), 8.0);
        let other = |rng: &mut ChaCha8Rng| draw_other(&config, OWN, own_velocity, rng);
        for axis in [|way: Displacement| way.north_m, |way: Displacement| way.east_m] {
            let offset = |rng: &mut ChaCha8Rng| axis(other(rng).0 - OWN);
            let (mean, variance) = moments(|rng| offset(rng).abs());
            assert_near(mean, 2250.0, 22.0, "mean offset, U(1500, 3000) m");
            assert_near(variance, 1500.0 * 1500.0 / 12.0, 6500.0, "its variance");
            let (mean, _) = moments(|rng| offset(rng).signum());
            assert_near(mean, 0.0, 0.05, "both signs alike");
        }
        let (mean, _) = moments(|rng| {
            let (position, _) = other(rng);
            ((position - OWN).north_m * (position - OWN).east_m).signum()
        });
        assert_near(mean, 0.0, 0.05, "signs are independent");
        // Of all courses, those that keep clear, alike: the accepted share of a half circle is its share of them.
        let clear = |position: Position, course_deg: f64| {
            let velocity = Velocity::from_course(Nautical::from_degrees(course_deg), 8.0);
            closest_approach(OWN.xy(), own_velocity.xy(), position.xy(), velocity.xy()).distance_m >= 800.0
        };
        let exact = CoastalConfig { linear_speed_sd_mps: 0.0, ..config };
        let (mut eastward, mut expected) = (0.0, 0.0);
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        for _ in 0..DRAWS {
            let (position, velocity) = draw_other(&exact, OWN, own_velocity, &mut rng);
            eastward += f64::from(u8::from(velocity.east_mps > 0.0)) / DRAWS as f64;
            let allowed: Vec<f64> = (0..120)
                .map(|k| 1.5 + 3.0 * f64::from(k))
                .filter(|&course| clear(position, course))
                .collect();
            let east = allowed.iter().filter(|&&course| course < 180.0).count();
            expected += east as f64 / allowed.len() as f64 / DRAWS as f64;
        }
        assert_near(eastward, expected, 0.02, "share of courses to the east");
    }

    #[test]
    fn own_ship_is_disturbed_by_its_formulas() {
        let config = CoastalConfig::default();
        let start = HeadOnStart { track: 0, mmsi: 1, index: 75 };
        let starts =
            HeadOnStarts { before_curve: vec![start], straight_on: vec![start], ..HeadOnStarts::default() };
        let target = Velocity::from_course(Nautical::from_degrees(30.0), 6.0);
        let opening = |rng: &mut ChaCha8Rng| {
            Opening::draw(&config, &starts, 5.0, |_| (Position::ORIGIN, target), rng).unwrap()
        };
        for axis in [|way: Displacement| way.north_m, |way: Displacement| way.east_m] {
            let (mean, variance) = moments(|rng| {
                let opening = opening(rng);
                axis(opening.own_position - opening.path.position)
            });
            assert_near(mean, 0.0, 0.04, "mean disturbance");
            assert_near(variance, 1.0, 0.06, "its variance");
        }
        let (mean, variance) = moments(|rng| {
            let opening = opening(rng);
            opening.own_heading.turn_from(opening.path.course).to_degrees()
        });
        assert_near(mean, -1.5, 0.04, "mean heading, U(-3, 0) degrees");
        assert_near(variance, 0.75, 0.03, "its variance, 3^2 / 12");
        let (mean, _) = moments(|rng| f64::from(u8::from(opening(rng).kind == HeadOnKind::BeforeCurve)));
        assert_near(mean, 0.5, 0.03, "both scenarios alike");
        // 240 s to collision at 8 and 6 m/s, on the reciprocal course.
        let path = opening(&mut ChaCha8Rng::seed_from_u64(1)).path;
        assert_near(path.position.distance_m(Position::ORIGIN), 240.0 * 14.0, 1e-6, "distance at the start");
        assert_near(path.course.degrees(), 210.0, 1e-9, "course at the start");
    }
}
