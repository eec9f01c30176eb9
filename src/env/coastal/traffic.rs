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
