//! One evaluation of the MMG derivative of KVLCC2.
//!
//! Subject: motions all over what a turn goes through. There is no rival: the bar is an absolute 300
//! nanoseconds.

use std::hint::black_box;
use std::time::Instant;

use searoom::vessel::mmg::dynamics::derivative;
use searoom::vessel::mmg::{Actuators, Hydrodynamics, MmgMotion, MmgParameters, Surroundings};

const MOTIONS: usize = 1024;
const REPEATS: usize = 400;
const BAR_NS: f64 = 300.0;

fn main() {
    let ship = Hydrodynamics::new(MmgParameters::default());
    let surroundings = Surroundings::default();
    let motions: Vec<_> = (0..MOTIONS)
        .map(|k| {
            let phase = k as f64 / MOTIONS as f64;
            let motion = MmgMotion {
                heading_rad: 6.0 * phase,
                surge_mps: 8.0 - 4.0 * phase,
                sway_mps: -1.2 * (9.0 * phase).sin(),
                yaw_rate_rad_per_s: 0.008 * (7.0 * phase).sin(),
                ..MmgMotion::default()
            };
            (motion, Actuators { rudder_rad: 0.6 * (11.0 * phase).cos(), revolutions_per_s: 1.5 })
        })
        .collect();
    let mut best_ns = f64::INFINITY;
    for _ in 0..REPEATS {
        let begin = Instant::now();
        for (motion, actuators) in &motions {
            black_box(derivative(&ship, black_box(motion), actuators, &surroundings));
        }
        best_ns = best_ns.min(begin.elapsed().as_secs_f64() * 1e9 / MOTIONS as f64);
    }
    println!("mmg-derivative cores 1 ratio {:.2} (ours {best_ns:.0} ns, bar {BAR_NS} ns)", BAR_NS / best_ns);
}
