//! Open water with passing rules: the paper's training environment (section "Training environment",
//! appendix "Environment details").
//!
//! The agent goes through a field of obstacles at constant longitudinal speed and has to leave each on
//! the side that its rule asks for. Axes: `x` is the direction of travel, `y` to port.
//!
//! | action | range | unit |
//! | --- | --- | --- |
//! | lateral acceleration over its greatest value | `[-1, 1]`, clipped | 0.01 m/s² |
//!
//! | observation | value | scale |
//! | --- | --- | --- |
//! | 0 | lateral acceleration last applied | 0.01 m/s² |
//! | 1, 2 | longitudinal and lateral speed of the agent | 5 m/s |
//! | 3 + 4 j, 4 + 4 j | agent's less obstacle's position, `x` and `y` | 3000 m |
//! | 5 + 4 j | estimated DCPA | 400 m |
//! | 6 + 4 j | estimated TCPA | 300 s |
//!
//! `j` counts obstacles: the block of rule right, then that of rule left, each by ascending estimated
//! TCPA. Without estimates there are two values per obstacle and blocks are sorted by distance. Ties
//! go to the lower index. Values are not clipped and may leave `[-1, 1]`.
//!
//! | reward term | value |
//! | --- | --- |
//! | `wrong_passings` | minus the number of obstacles passed on the wrong side in this step |

mod config;
mod field;
mod path;
mod risk;

pub use config::{MotionKind, OpenWaterConfig};
pub use field::{Agent, Field, HISTORY_POSITIONS, Obstacle, Passing, PassingRule};
pub use path::DesiredPath;
pub use risk::{RiskEstimates, to_position};

use nalgebra::Vector2;

use super::{ActionError, Env, RewardTerm, Step, check_action};
use crate::forecast::Forecaster;
use crate::geo::Velocity;
use crate::vessel::VesselState;
use crate::world::{Bow, Hull, HullError, PairReport, VesselBody, VesselId, World, WorldConfig};

/// The environment.
pub struct OpenWater {
    config: OpenWaterConfig,
    field: Field,
    world: World,
    states: Vec<VesselState>,
    risk: Option<RiskEstimates>,
    order: Vec<usize>,
    terms: [RewardTerm; 1],
}

impl OpenWater {
    /// The environment, at the start of the episode of seed 0. A forecaster makes estimates part of
    /// the observation; without one it is the baseline's.
    ///
    /// # Errors
    ///
    /// When the configured hull is none.
    pub fn new(config: OpenWaterConfig, forecaster: Option<Box<dyn Forecaster>>) -> Result<Self, HullError> {
        let field = Field::new(&config, 0);
        let body = VesselBody {
            hull: Hull::new(config.vessel_length_m, config.vessel_beam_m, Bow::default())?,
            collision_radius_m: config.collision_radius_m,
        };
        let mut world = World::new(WorldConfig { dt_s: config.dt_s, ..WorldConfig::default() });
        let mut states = Vec::new();
        read_states(&field, &mut states);
        let ids: Vec<VesselId> = states.iter().map(|state| world.add_vessel(body.clone(), *state)).collect();
        for &obstacle in &ids[1..] {
            world.watch(ids[0], obstacle);
        }
        let risk = forecaster.map(|forecaster| RiskEstimates::new(&config, forecaster));
        let terms = [RewardTerm { name: "wrong_passings", value: 0.0 }];
        Ok(Self { config, field, world, states, risk, order: Vec::new(), terms })
    }

    /// The constants in use.
    #[must_use]
    pub fn config(&self) -> &OpenWaterConfig {
        &self.config
    }

    /// Agent, obstacles and desired path as they are now.
    #[must_use]
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// Estimates of the collision risk, where they are made.
    #[must_use]
    pub fn risk(&self) -> Option<&RiskEstimates> {
        self.risk.as_ref()
    }

    /// What the last step brought between the agent and each obstacle, in the obstacles' order.
    #[must_use]
    pub fn reports(&self) -> &[PairReport] {
        self.world.reports()
    }

    fn estimate(&mut self) {
        if let Some(risk) = &mut self.risk {
            risk.refresh(&self.field, &self.config);
        }
    }

    fn observe(&mut self, observation: &mut [f32]) {
        let Self { config, field, order, .. } = self;
        let risk = self.risk.as_ref();
        let agent = field.agent();
        observation[0] = (agent.acceleration_mps2 / config.agent_acceleration_max_mps2) as f32;
        observation[1] = (agent.velocity.x / config.agent_speed_max_mps) as f32;
        observation[2] = (agent.velocity.y / config.agent_speed_max_mps) as f32;
        let mut values = observation[3..].iter_mut();
        let mut write = |value: f64| {
            if let Some(slot) = values.next() {
                *slot = value as f32;
            }
        };
        let per_rule = config.obstacles_per_rule;
        let relative =
            |index: usize| -> Vector2<f64> { agent.position - field.obstacles()[index].position() };
        for first in [0, per_rule] {
            order.clear();
            order.extend(first..first + per_rule);
            let key = |index: usize| match risk {
                Some(risk) => risk.estimates()[index].time_s,
                None => relative(index).norm_squared(),
            };
            // A stable sort: ties stay with the lower index.
            order.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
            for &index in order.iter() {
                let apart = relative(index) / config.position_scale_m;
                write(apart.x);
                write(apart.y);
                if let Some(risk) = risk {
                    write(risk.estimates()[index].distance_m / config.dcpa_scale_m);
                    write(risk.estimates()[index].time_s / config.tcpa_scale_s);
                }
            }
        }
    }
}

impl Env for OpenWater {
    fn observation_len(&self) -> usize {
        self.config.observation_len(self.risk.is_some())
    }

    fn action_len(&self) -> usize {
        1
    }

    fn max_decisions(&self) -> usize {
        self.config.decisions
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        self.field = Field::new(&self.config, seed);
        read_states(&self.field, &mut self.states);
        self.world.reset(&self.states);
        self.terms[0].value = 0.0;
        self.estimate();
        self.observe(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        check_action(action, 1)?;
        if self.field.step() >= self.config.decisions {
            return Err(ActionError::EpisodeOver);
        }
        self.field.advance(f64::from(action[0]));
        read_states(&self.field, &mut self.states);
        self.world.step(&self.states);
        let wrong = self.field.passings().iter().filter(|passing| passing.wrong).count();
        let reward = -(wrong as f64);
        self.terms[0].value = reward;

        self.field.replace_passed();
        read_states(&self.field, &mut self.states);
        for &obstacle in self.field.replaced() {
            self.world.place(VesselId(obstacle + 1), &self.states[obstacle + 1]);
        }
        self.estimate();
        self.observe(observation);
        Ok(Step { reward, terminated: false, truncated: self.field.step() == self.config.decisions })
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        &self.terms
    }
}

/// The agent first, then the obstacles.
fn read_states(field: &Field, states: &mut Vec<VesselState>) {
    let on_compass = |position: Vector2<f64>, velocity: Vector2<f64>| {
        let velocity = Velocity { north_mps: velocity.y, east_mps: velocity.x };
        VesselState { position: to_position(position), velocity, heading: velocity.course() }
    };
    states.clear();
    states.push(on_compass(field.agent().position, field.agent().velocity));
    states
        .extend(field.obstacles().iter().map(|obstacle| on_compass(obstacle.position(), obstacle.velocity)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forecast::LinearForecaster;

    fn baseline() -> OpenWater {
        OpenWater::new(OpenWaterConfig::default(), None).unwrap()
    }

    fn with_estimates() -> OpenWater {
        OpenWater::new(OpenWaterConfig::default(), Some(Box::new(LinearForecaster::over(10)))).unwrap()
    }

    #[test]
    fn observations_have_the_documented_lengths() {
        assert_eq!(baseline().observation_len(), 23);
        assert_eq!(with_estimates().observation_len(), 43);
    }

    #[test]
    fn a_time_limit_truncates_and_never_terminates() {
        let mut env = baseline();
        let mut observation = vec![0.0; 23];
        env.reset(1, &mut observation);
        for decision in 1..=500 {
            let step = env.step(&[0.1], &mut observation).unwrap();
            assert!(!step.terminated);
            assert_eq!(step.truncated, decision == 500);
        }
        assert_eq!(env.step(&[0.1], &mut observation), Err(ActionError::EpisodeOver));
    }

    #[test]
    fn actions_that_cannot_be_taken_are_refused_and_change_nothing() {
        let mut env = baseline();
        let mut observation = vec![0.0; 23];
        env.reset(1, &mut observation);
        let position = env.field().agent().position;
        assert!(matches!(
            env.step(&[f32::NAN], &mut observation),
            Err(ActionError::NotFinite { index: 0, .. })
        ));
        assert_eq!(
            env.step(&[0.0, 0.0], &mut observation),
            Err(ActionError::Length { given: 2, expected: 1 })
        );
        assert_eq!(env.field().agent().position, position);
        assert_eq!(env.field().step(), 0);
    }

    /// The return is minus the number of wrong passings, counted by hand beside it.
    #[test]
    fn the_return_counts_wrong_passings() {
        let mut wrong = 0;
        for seed in 0..5 {
            let mut env = baseline();
            let mut observation = vec![0.0; 23];
            env.reset(seed, &mut observation);
            let mut total = 0.0;
            loop {
                let step = env.step(&[-1.0], &mut observation).unwrap();
                total += step.reward;
                assert_eq!(step.reward, env.reward_terms()[0].value);
                let broken = env.field().passings().iter().filter(|passing| {
                    let right = passing.obstacle < 5;
                    if right { passing.lateral_m >= 0.0 } else { passing.lateral_m <= 0.0 }
                });
                wrong += broken.count();
                if step.ends_episode() {
                    break;
                }
            }
            assert_eq!(total, -(std::mem::take(&mut wrong) as f64));
            assert!(total < 0.0, "full starboard all the way breaks the rules of the left");
        }
    }

    #[test]
    fn observations_hold_what_the_table_says() {
        let mut env = with_estimates();
        let mut observation = vec![0.0; 43];
        env.reset(8, &mut observation);
        assert_eq!(observation[0], 0.0);
        for _ in 0..37 {
            env.step(&[0.5], &mut observation).unwrap();
        }
        let agent = *env.field().agent();
        assert!((observation[0] - 0.5).abs() < 1e-6);
        assert!((f64::from(observation[1]) - agent.velocity.x / 5.0).abs() < 1e-6);
        assert!((f64::from(observation[2]) - agent.velocity.y / 5.0).abs() < 1e-6);
        let estimates = env.risk().unwrap().estimates().to_vec();
        for (block, first) in [(0, 0), (1, 5)] {
            let values: Vec<&[f32]> = observation[3 + block * 20..][..20].chunks(4).collect();
            assert!(values.windows(2).all(|pair| pair[0][3] <= pair[1][3]), "sorted by TCPA");
            for value in values {
                let index = (first..first + 5)
                    .find(|&index| {
                        let estimate = estimates[index];
                        (estimate.time_s / 300.0 - f64::from(value[3])).abs() < 1e-5
                            && (estimate.distance_m / 400.0 - f64::from(value[2])).abs() < 1e-5
                    })
                    .unwrap();
                let apart = (agent.position - env.field().obstacles()[index].position()) / 3000.0;
                assert!((apart.x - f64::from(value[0])).abs() < 1e-6);
                assert!((apart.y - f64::from(value[1])).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_baseline_sorts_by_distance() {
        let mut env = baseline();
        let mut observation = vec![0.0; 23];
        env.reset(9, &mut observation);
        for block in observation[3..].chunks(10) {
            let distances: Vec<f32> = block.chunks(2).map(|apart| apart[0].hypot(apart[1])).collect();
            assert!(distances.is_sorted(), "{distances:?}");
        }
    }

    #[test]
    fn world_and_field_agree_on_distances() {
        let mut env = baseline();
        let mut observation = vec![0.0; 23];
        env.reset(10, &mut observation);
        for _ in 0..120 {
            env.step(&[0.2], &mut observation).unwrap();
            for (report, obstacle) in env.reports().iter().zip(env.field().obstacles()) {
                let distance_m = (env.field().agent().position - obstacle.position()).norm();
                assert!((report.centre_distance_m - distance_m).abs() < 1e-9);
                assert!(report.min_centre_distance_m <= distance_m + 1e-9);
            }
        }
    }
}
