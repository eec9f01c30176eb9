//! Encounters drawn at random, for policies to be tuned and tried on: one to three ships that would come close.

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::model::{OwnShip, Placement, RelativePlacement, Scenario, Steering, TargetMotion};
use super::placement::{Passes, WantedCpa};
use super::setup::StagedEncounter;
use crate::angle::Nautical;

/// What is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DrawnEncounters {
    /// Target ships at most; from one on, each number is as likely.
    pub targets_max: usize,
    /// Least and greatest speed of every ship, in metres per second.
    pub speed_mps: [f64; 2],
    /// Least and greatest time to the closest point of approach with each target ship, in seconds.
    pub tcpa_s: [f64; 2],
    /// Standard deviation of the distance there, to either side, in metres.
    pub dcpa_sd_m: f64,
    /// No target ship starts nearer than this, in metres.
    pub range_min_m: f64,
    /// How long an encounter is followed beyond the last closest point of approach, in seconds.
    pub after_s: f64,
    /// Ways in which own ship may be steered; each is as likely. The first default is that of the Imazu problems,
    /// the second that of the paper's coastal agent.
    pub steering: Vec<Steering>,
}

impl Default for DrawnEncounters {
    fn default() -> Self {
        Self {
            targets_max: 3,
            speed_mps: [3.0, 10.0],
            tcpa_s: [240.0, 1500.0],
            dcpa_sd_m: 200.0,
            range_min_m: 1500.0,
            after_s: 600.0,
            steering: vec![
                Steering { max_turn_deg: 5.0, decision_interval_s: 10.0, max_speed_change_mps: 0.25 },
                Steering::default(),
            ],
        }
    }
}

impl DrawnEncounters {
    /// The encounter of a seed.
    ///
    /// # Panics
    /// Where `steering` is empty.
    #[must_use]
    pub fn draw(&self, seed: u64) -> StagedEncounter {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Ships that keep up with own ship have no such point, and some start too near: they are drawn anew.
        loop {
            let staged = self.scenario(seed, &mut rng).set_up();
            if let Some(staged) = staged.ok().filter(|staged| self.is_apart(staged)) {
                return staged;
            }
        }
    }

    fn is_apart(&self, staged: &StagedEncounter) -> bool {
        let own = staged.own_start.position;
        staged.targets.iter().all(|target| target.motion.position(0).distance_m(own) >= self.range_min_m)
    }

    fn scenario(&self, seed: u64, rng: &mut ChaCha8Rng) -> Scenario {
        let mut own = OwnShip::heading(0.0).speed_mps(within(self.speed_mps, rng));
        own.steering = *self.steering.choose(rng).expect("a way to steer");
        let mut scenario = Scenario::new("drawn", own).seed(seed);
        let mut last_s = 0.0_f64;
        for index in 0..rng.random_range(1..=self.targets_max) {
            let tcpa_s = within(self.tcpa_s, rng);
            last_s = last_s.max(tcpa_s);
            let offset_m = self.dcpa_sd_m * rng.sample::<f64, _>(StandardNormal);
            let placement = RelativePlacement::CourseWithCpa {
                course: Nautical::from_degrees(rng.random_range(0.0..360.0)),
                speed_mps: within(self.speed_mps, rng),
                cpa: WantedCpa {
                    dcpa_m: offset_m.abs(),
                    tcpa_s,
                    passes: Some(if offset_m < 0.0 { Passes::Port } else { Passes::Starboard }),
                },
            };
            let motion = TargetMotion::Linear(Placement::FromOwnShip(placement));
            scenario = scenario.target(&format!("ship {}", index + 1), motion);
        }
        let steps = ((last_s + self.after_s) / scenario.dt_s).ceil();
        let duration_s = steps * scenario.dt_s;
        scenario.duration_s(duration_s)
    }
}

fn within(range: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    rng.random_range(range[0]..=range[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::HoldCourse;

    #[test]
    fn equal_seeds_draw_equal_encounters_that_come_close() {
        let drawn = DrawnEncounters::default();
        let mut contacts = 0;
        for seed in 0..40 {
            let episode = drawn.draw(seed).run_under(&mut HoldCourse);
            assert_eq!(episode, drawn.draw(seed).run_under(&mut HoldCourse));
            for summary in episode.summaries() {
                assert!(summary.start_distance_m >= drawn.range_min_m);
                assert!((summary.closest_centre_m - summary.start_cpa.distance_m).abs() < 1e-6);
                assert!(summary.closest_centre_time_s <= 1500.0);
            }
            contacts += usize::from(episode.has_contact());
        }
        assert!((25..40).contains(&contacts), "{contacts}");
    }
}
