//! One world step with five vessels and all ten pairs reported.
//!
//! Subject: an own ship that turns at every fourth step, a vessel whose heading wanders as that of a
//! recorded track does, and three on straight courses, all meeting in the middle. There is no rival:
//! the bar is an absolute 10 microseconds a step.

use std::hint::black_box;
use std::time::Instant;

use searoom::angle::Nautical;
use searoom::geo::{Displacement, Position};
use searoom::vessel::VesselState;
use searoom::world::{Bow, Hull, HullError, VesselBody, World, WorldConfig};

const STEPS: usize = 120;
const REPEATS: usize = 400;
const BAR_US: f64 = 10.0;

fn states() -> Vec<[VesselState; 5]> {
    let mut heading = Nautical::NORTH;
    let mut own = Position { north_m: -2400.0, east_m: 0.0 };
    (0..STEPS)
        .map(|step| {
            let time_s = 5.0 * step as f64;
            if step % 4 == 0 {
                heading = heading.turned(if step < 60 { 2.4_f64 } else { -2.4 }.to_radians());
            }
            own += Displacement::towards(heading, 40.0);
            let straight = |course_deg: f64, speed_mps: f64| {
                let course = Nautical::from_degrees(course_deg);
                let way = Displacement::towards(course, speed_mps * (time_s - 300.0));
                VesselState::on_course(Position::ORIGIN + way, course, speed_mps)
            };
            let mut recorded = straight(180.0, 7.0);
            recorded.heading = recorded.heading.turned(0.02 * (0.3 * step as f64).sin());
            let own = VesselState::on_course(own, heading, 8.0);
            [own, recorded, straight(250.0, 6.0), straight(100.0, 9.0), straight(350.0, 5.0)]
        })
        .collect()
}

fn main() -> Result<(), HullError> {
    let states = states();
    let mut world = World::new(WorldConfig::default());
    for (state, length_m) in states[0].iter().zip([180.0, 300.0, 90.0, 140.0, 50.0]) {
        let hull = Hull::new(length_m, length_m / 6.5, Bow::Normal)?;
        world.add_vessel(VesselBody { hull, collision_radius_m: 150.0 }, *state);
    }
    world.watch_all();
    let mut best_us = f64::INFINITY;
    let mut total_us = 0.0;
    for _ in 0..REPEATS {
        world.reset(&states[0]);
        let begin = Instant::now();
        for next in &states[1..] {
            black_box(world.step(black_box(next)));
        }
        let step_us = begin.elapsed().as_secs_f64() * 1e6 / (STEPS - 1) as f64;
        best_us = best_us.min(step_us);
        total_us += step_us;
    }
    let mean_us = total_us / REPEATS as f64;
    println!(
        "world-step cores 1 ratio {:.2} (ours {mean_us:.2} us mean, {best_us:.2} us best, bar {BAR_US} us)",
        BAR_US / mean_us
    );
    Ok(())
}
