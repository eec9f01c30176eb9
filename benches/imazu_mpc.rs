//! An Imazu problem with three target ships under predictive control.
//!
//! Subject: problem 19, 30 simulated minutes, all that `searoom scenario run` simulates: own ship, the world with
//! every contact within its steps, 180 decisions. There is no rival: the bar is an absolute second on one core.

use std::hint::black_box;
use std::time::Instant;

use searoom::policy::by_name;
use searoom::scenario::imazu::ImazuProblems;

const PROBLEM: u32 = 19;
const DURATION_S: f64 = 1800.0;
const REPEATS: usize = 10;
const BAR_S: f64 = 1.0;

fn main() {
    let mut file = ImazuProblems::shipped().scenario(PROBLEM).expect("a problem");
    file.scenario.duration_s = DURATION_S;
    let staged = file.set_up().expect("it can be set up");
    let mut policy = by_name("mpc").expect("a policy");
    let mut best_s = f64::INFINITY;
    for _ in 0..REPEATS {
        let begin = Instant::now();
        black_box(staged.run_under(policy.as_mut()));
        best_s = best_s.min(begin.elapsed().as_secs_f64());
    }
    println!("imazu-mpc cores 1 ratio {:.2} (ours {best_s:.3} s, bar {BAR_S} s)", BAR_S / best_s);
}
