//! The field of obstacles and the agent's motion in it: dynamics, placement, replacement, passings.
//!
//! Axes: `x` is the direction of travel, `y` to port, right-handed. Paper, section "Training
//! environment" and appendix "Environment details"; equation names below are theirs.

use std::collections::VecDeque;

use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::OpenWaterConfig;
use super::config::MotionKind;
use super::path::DesiredPath;
use crate::vessel::{OffsetProcess, periodic, stochastic};

/// On which side the agent has to leave an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PassingRule {
    /// Pass with `y_agent < y_i`.
    Right,
    /// Pass with `y_agent > y_i`.
    Left,
}

/// The agent: a point mass of constant longitudinal speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agent {
    /// Position, in metres.
    pub position: Vector2<f64>,
    /// Velocity, in metres per second.
    pub velocity: Vector2<f64>,
    /// Lateral acceleration last applied, in metres per second squared.
    pub acceleration_mps2: f64,
}

/// The non-linear part of one obstacle's motion.
#[derive(Debug, Clone)]
enum Offsets {
    Stochastic(stochastic::Process),
    Periodic(periodic::Process),
}

impl Offsets {
    fn next(&mut self, rng: &mut ChaCha8Rng) -> Vector2<f64> {
        match self {
            Self::Stochastic(process) => process.next_offset(rng),
            Self::Periodic(process) => process.next_offset(rng),
        }
    }
}

/// One obstacle.
#[derive(Debug, Clone)]
pub struct Obstacle {
    /// Side on which it has to be passed.
    pub rule: PassingRule,
    /// Time to collision `TTC` in the direction of travel, in seconds; negative once passed.
    pub ttc_s: f64,
    /// Velocity of the linear part, in metres per second.
    pub velocity: Vector2<f64>,
    /// Steps since it appeared.
    pub age_steps: usize,
    linear: Vector2<f64>,
    offsets: Offsets,
    history: VecDeque<Vector2<f64>>,
}

impl Obstacle {
    /// Its position, the non-linear part included.
    #[must_use]
    pub fn position(&self) -> Vector2<f64> {
        self.history[self.history.len() - 1]
    }

    /// Its latest positions, oldest first, the present one last; those before it appeared too.
    pub fn history(&self) -> impl ExactSizeIterator<Item = Vector2<f64>> + '_ {
        self.history.iter().copied()
    }

    fn advance(&mut self, dt_s: f64, rng: &mut ChaCha8Rng) {
        self.linear += self.velocity * dt_s;
        self.ttc_s -= dt_s;
        self.age_steps += 1;
        self.history.pop_front();
        self.history.push_back(self.linear + self.offsets.next(rng));
    }
}

/// An obstacle passed in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passing {
    /// Index of the obstacle.
    pub obstacle: usize,
    /// Whether the rule was broken.
    pub wrong: bool,
    /// `y_agent - y_i` at `TTC = 0`, in metres.
    pub lateral_m: f64,
}

/// Agent, obstacles and desired path of one episode.
#[derive(Debug, Clone)]
pub struct Field {
    config: OpenWaterConfig,
    rng: ChaCha8Rng,
    path: DesiredPath,
    agent: Agent,
    obstacles: Vec<Obstacle>,
    passings: Vec<Passing>,
    replaced: Vec<usize>,
    step: usize,
}

/// Positions of history that are kept for each obstacle: what the forecaster reads.
pub const HISTORY_POSITIONS: usize = 10;

impl Field {
    /// Draws an episode.
    #[must_use]
    pub fn new(config: &OpenWaterConfig, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let speed_mps = rng.random_range(config.agent_speed_min_mps..=config.agent_speed_max_mps);
        let path = DesiredPath::draw(config, &mut rng);
        let agent = Agent {
            position: Vector2::zeros(),
            velocity: Vector2::new(speed_mps, 0.0),
            acceleration_mps2: 0.0,
        };
        let mut field = Self {
            config: config.clone(),
            rng,
            path,
            agent,
            obstacles: Vec::with_capacity(2 * config.obstacles_per_rule),
            passings: Vec::new(),
            replaced: Vec::new(),
            step: 0,
        };
        field.place_all();
        field
    }

    /// The agent.
    #[must_use]
    pub fn agent(&self) -> &Agent {
        &self.agent
    }

    /// The obstacles, those of rule right first.
    #[must_use]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// The desired path.
    #[must_use]
    pub fn path(&self) -> &DesiredPath {
        &self.path
    }

    /// Steps since the start of the episode.
    #[must_use]
    pub fn step(&self) -> usize {
        self.step
    }

    /// Obstacles passed in the last step.
    #[must_use]
    pub fn passings(&self) -> &[Passing] {
        &self.passings
    }

    /// Obstacles replaced last, by index.
    #[must_use]
    pub fn replaced(&self) -> &[usize] {
        &self.replaced
    }

    /// Moves everything on by one step and notes passings; [`Self::replace_passed`] comes next.
    /// `action` is the lateral acceleration over its greatest value, clipped to `[-1, 1]`.
    pub fn advance(&mut self, action: f64) {
        let dt_s = self.config.dt_s;
        let before = self.agent;
        self.agent.advance(action, &self.config);
        self.passings.clear();
        for (index, obstacle) in self.obstacles.iter_mut().enumerate() {
            let (ttc_s, lateral_m) = (obstacle.ttc_s, obstacle.position().y);
            obstacle.advance(dt_s, &mut self.rng);
            if ttc_s > 0.0 && obstacle.ttc_s <= 0.0 {
                let fraction = ttc_s / dt_s;
                let agent_m = before.position.y + (self.agent.position.y - before.position.y) * fraction;
                let obstacle_m = lateral_m + (obstacle.position().y - lateral_m) * fraction;
                self.passings.push(Passing::judged(index, obstacle.rule, agent_m - obstacle_m));
            }
        }
        self.step += 1;
    }

    /// Replaces obstacles that are behind: as soon as two of a rule are, the one passed earlier.
    pub fn replace_passed(&mut self) {
        self.replaced.clear();
        self.replace(PassingRule::Right);
        self.replace(PassingRule::Left);
    }

    fn place_all(&mut self) {
        for rule in [PassingRule::Right, PassingRule::Left] {
            let first_ttc_s = self.rng.random_range(-self.config.ttc_spacing_max_s..0.0);
            let first = self.draw_obstacle(rule, first_ttc_s);
            self.obstacles.push(first);
            for _ in 1..self.config.obstacles_per_rule {
                let ttc_s = self.draw_ttc_s(rule);
                let next = self.draw_obstacle(rule, ttc_s);
                self.obstacles.push(next);
            }
            self.replace(rule);
        }
        self.replaced.clear();
    }

    fn replace(&mut self, rule: PassingRule) {
        loop {
            let of_rule = self.obstacles.iter().enumerate().filter(|(_, obstacle)| obstacle.rule == rule);
            let passed = of_rule.filter(|(_, obstacle)| obstacle.ttc_s < 0.0);
            let earliest =
                passed.clone().min_by(|a, b| a.1.ttc_s.total_cmp(&b.1.ttc_s)).map(|(index, _)| index);
            let Some(index) = earliest.filter(|_| passed.count() >= 2) else { return };
            let ttc_s = self.draw_ttc_s(rule);
            self.obstacles[index] = self.draw_obstacle(rule, ttc_s);
            self.replaced.push(index);
        }
    }

    /// `TTC ~ U(max_j TTC_j, max_j TTC_j + dTTC_max)` over the obstacles of a rule.
    fn draw_ttc_s(&mut self, rule: PassingRule) -> f64 {
        let of_rule = self.obstacles.iter().filter(|obstacle| obstacle.rule == rule);
        let latest_s = of_rule.map(|obstacle| obstacle.ttc_s).fold(f64::NEG_INFINITY, f64::max);
        self.rng.random_range(latest_s..latest_s + self.config.ttc_spacing_max_s)
    }

    /// An obstacle that the agent meets after `ttc_s`, near the desired path, with its history.
    fn draw_obstacle(&mut self, rule: PassingRule, ttc_s: f64) -> Obstacle {
        let config = &self.config;
        let rng = &mut self.rng;
        let speed_max_mps = config.obstacle_speed_max_mps;
        let velocity = Vector2::from_fn(|_, _| rng.random_range(-speed_max_mps..=speed_max_mps));
        let normal: f64 = rng.sample(StandardNormal);
        let beside_m = (config.path_distance_mean_m + config.path_distance_sd_m * normal)
            .max(config.path_distance_min_m);
        let path_m = self.path.at(self.step as f64 + ttc_s / config.dt_s);
        let abeam_m = match rule {
            PassingRule::Right => path_m + beside_m,
            PassingRule::Left => path_m - beside_m,
        };
        let linear = Vector2::new(
            (self.agent.velocity.x - velocity.x) * ttc_s + self.agent.position.x,
            abeam_m - velocity.y * ttc_s,
        );
        let (mut offsets, burn_in_steps) = match config.motion {
            MotionKind::Stochastic => (
                Offsets::Stochastic(stochastic::Process::new(config.stochastic, velocity)),
                config.stochastic.burn_in_steps,
            ),
            MotionKind::Periodic => (
                Offsets::Periodic(periodic::Process::new(config.periodic, velocity, rng)),
                config.periodic.burn_in_steps,
            ),
        };
        let first_kept = (burn_in_steps + 1).saturating_sub(HISTORY_POSITIONS);
        for _ in 0..first_kept {
            offsets.next(rng);
        }
        let kept = burn_in_steps + 1 - first_kept;
        let history = (0..kept)
            .map(|k| linear - velocity * (config.dt_s * (kept - 1 - k) as f64) + offsets.next(rng))
            .collect();
        Obstacle { rule, ttc_s, velocity, age_steps: 0, linear, offsets, history }
    }
}

impl Agent {
    /// Euler for the lateral speed, ballistic (trapezoid) for the position.
    fn advance(&mut self, action: f64, config: &OpenWaterConfig) {
        let before = self.velocity;
        self.acceleration_mps2 = config.agent_acceleration_max_mps2 * action.clamp(-1.0, 1.0);
        let speed_max_mps = config.agent_speed_max_mps;
        self.velocity.y =
            (before.y + self.acceleration_mps2 * config.dt_s).clamp(-speed_max_mps, speed_max_mps);
        self.position += (before + self.velocity) * (0.5 * config.dt_s);
    }
}

impl Passing {
    fn judged(obstacle: usize, rule: PassingRule, lateral_m: f64) -> Self {
        let kept = match rule {
            PassingRule::Right => lateral_m < 0.0,
            PassingRule::Left => lateral_m > 0.0,
        };
        Self { obstacle, wrong: !kept, lateral_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> OpenWaterConfig {
        OpenWaterConfig::default()
    }

    /// Without noise and wander every obstacle keeps to its straight line.
    fn calm() -> OpenWaterConfig {
        let mut config = config();
        config.stochastic.innovation_sd_m = 0.0;
        config
    }

    #[test]
    fn the_agent_moves_as_computed_by_hand() {
        let mut agent =
            Agent { position: Vector2::zeros(), velocity: Vector2::new(3.0, 0.0), acceleration_mps2: 0.0 };
        agent.advance(1.0, &config());
        assert_eq!(agent.velocity, Vector2::new(3.0, 0.05));
        assert_eq!(agent.position, Vector2::new(15.0, 0.125));
        agent.advance(-0.5, &config());
        assert!((agent.velocity.y - 0.025).abs() < 1e-15);
        assert!((agent.position.y - 0.3125).abs() < 1e-15);
        agent.velocity.y = 4.99;
        agent.advance(7.0, &config());
        assert_eq!(agent.velocity.y, 5.0);
        assert_eq!(agent.acceleration_mps2, 0.01);
    }

    #[test]
    fn obstacles_come_abeam_when_their_time_is_up() {
        for seed in 0..20 {
            let mut field = Field::new(&calm(), seed);
            for _ in 0..200 {
                let before: Vec<_> =
                    field.obstacles().iter().map(|o| o.position().x - field.agent().position.x).collect();
                field.advance(0.3);
                for passing in field.passings() {
                    let obstacle = &field.obstacles()[passing.obstacle];
                    let after_m = obstacle.position().x - field.agent().position.x;
                    assert!(before[passing.obstacle] * after_m <= 1e-9, "did not change sides: {after_m}");
                }
                field.replace_passed();
            }
        }
    }

    #[test]
    fn at_most_one_obstacle_of_a_rule_stays_behind() {
        for seed in 0..30 {
            let mut field = Field::new(&config(), seed);
            for _ in 0..300 {
                for rule in [PassingRule::Right, PassingRule::Left] {
                    let behind = field.obstacles().iter().filter(|o| o.rule == rule && o.ttc_s < 0.0).count();
                    assert!(behind <= 1);
                    assert_eq!(field.obstacles().iter().filter(|o| o.rule == rule).count(), 5);
                }
                field.advance(0.0);
                field.replace_passed();
            }
        }
    }

    /// Placement against its formulas: spacing of TTC, velocities, distance from the path.
    #[test]
    fn obstacles_are_placed_by_their_distributions() {
        let config = calm();
        let (mut spacing, mut along, mut beside, mut at_bound) = (0.0, 0.0, 0.0, 0);
        let episodes = 2000;
        for seed in 0..episodes {
            let field = Field::new(&config, seed);
            let right = &field.obstacles()[..5];
            let mut times: Vec<f64> = right.iter().map(|obstacle| obstacle.ttc_s).collect();
            times.sort_by(f64::total_cmp);
            spacing += times[4] - times[3];
            for obstacle in right {
                along += obstacle.velocity.x.powi(2) / 5.0;
                let abeam_m = obstacle.position().y + obstacle.velocity.y * obstacle.ttc_s;
                let distance_m = abeam_m - field.path().at(obstacle.ttc_s / config.dt_s);
                assert!(distance_m > 40.0 - 1e-6);
                at_bound += u32::from(distance_m < 40.0 + 1e-6);
                beside += distance_m / 5.0;
            }
        }
        let episodes = episodes as f64;
        // The last spacing is uniform on [0, 300] s.
        assert!((spacing / episodes - 150.0).abs() < 6.0, "{}", spacing / episodes);
        // U(-5, 5) has variance 25 / 3.
        assert!((along / episodes - 25.0 / 3.0).abs() < 0.25, "{}", along / episodes);
        // max(40, N(100, 50^2)): mean 40 + 60 Phi(1.2) + 50 phi(1.2) = 102.81, at the bound with 1 - Phi(1.2) = 0.1151.
        assert!((beside / episodes - 102.81).abs() < 1.5, "{}", beside / episodes);
        assert!((f64::from(at_bound) / (5.0 * episodes) - 0.1151).abs() < 0.01);
    }

    #[test]
    fn following_the_path_keeps_the_rules_in_calm_conditions() {
        // An agent that could jump to the path would break no rule: check the judgement, not the agent.
        let mut judged = 0;
        for seed in 0..10 {
            let mut field = Field::new(&calm(), seed);
            for _ in 0..500 {
                field.advance(0.0);
                for passing in &field.passings {
                    let Passing { lateral_m, wrong, .. } = *passing;
                    let right = passing.obstacle < 5;
                    assert_eq!(wrong, if right { lateral_m >= 0.0 } else { lateral_m <= 0.0 });
                    let on_path_m = lateral_m - field.agent.position.y + field.path.at(field.step as f64);
                    // Within the step the path and the agent move a little; 40 m is the least distance.
                    assert!(if right { on_path_m < -30.0 } else { on_path_m > 30.0 }, "{on_path_m}");
                    judged += 1;
                }
                field.replace_passed();
            }
        }
        assert!(judged > 300, "{judged}");
    }

    #[test]
    fn equal_seeds_give_equal_bits_whatever_the_agent_does() {
        let (mut calm, mut wild) = (Field::new(&config(), 9), Field::new(&config(), 9));
        for step in 0..200 {
            calm.advance(0.0);
            wild.advance(if step % 3 == 0 { 1.0 } else { -0.4 });
            calm.replace_passed();
            wild.replace_passed();
            for (a, b) in calm.obstacles().iter().zip(wild.obstacles()) {
                assert_eq!(a.position(), b.position());
            }
        }
    }

    #[test]
    fn an_obstacle_appears_with_its_whole_history() {
        let field = Field::new(&calm(), 3);
        for obstacle in field.obstacles() {
            let history: Vec<_> = obstacle.history().collect();
            assert_eq!(history.len(), HISTORY_POSITIONS);
            for pair in history.windows(2) {
                assert!((pair[1] - pair[0] - obstacle.velocity * 5.0).norm() < 1e-9);
            }
        }
    }

    /// Both velocity components are U(-5, 5) for either rule, the longitudinal speed of the agent U(1, 5), the
    /// first time to collision at reset U(-300, 0) where nothing was replaced.
    #[test]
    fn velocities_are_drawn_by_their_distributions() {
        let episodes = 1500;
        let (mut agent_speed, mut moments, mut negative) = ([0.0; 2], [[0.0; 2]; 4], 0);
        for seed in 0..episodes {
            let field = Field::new(&calm(), seed);
            let speed_mps = field.agent().velocity.x;
            agent_speed[0] += speed_mps;
            agent_speed[1] += (speed_mps - 3.0).powi(2);
            for obstacle in field.obstacles() {
                let first = if obstacle.rule == PassingRule::Right { 0 } else { 2 };
                for (slot, value) in [obstacle.velocity.x, obstacle.velocity.y].into_iter().enumerate() {
                    moments[first + slot][0] += value / 5.0;
                    moments[first + slot][1] += value * value / 5.0;
                    assert!(value.abs() <= 5.0);
                }
            }
            negative += field.obstacles().iter().filter(|obstacle| obstacle.ttc_s < 0.0).count();
        }
        let episodes = episodes as f64;
        assert!((agent_speed[0] / episodes - 3.0).abs() < 0.09, "U(1, 5) has mean 3");
        assert!((agent_speed[1] / episodes - 4.0 / 3.0).abs() < 0.09, "and variance 4 / 3");
        for [mean, square] in moments {
            assert!((mean / episodes).abs() < 0.1, "U(-5, 5) has mean 0: {}", mean / episodes);
            assert!(
                (square / episodes - 25.0 / 3.0).abs() < 0.25,
                "and variance 25 / 3: {}",
                square / episodes
            );
        }
        // Every rule begins with one obstacle behind, and at most one is left there.
        assert!(negative as f64 / episodes > 1.9 && negative as f64 / episodes <= 2.0, "{negative}");
    }

    /// TTC = 2 s at the beginning of a 5 s step: both laterals are read after 2 / 5 of it.
    #[test]
    fn a_passing_is_judged_where_both_are_abeam() {
        let mut field = Field::new(&calm(), 1);
        field.agent.position = Vector2::new(100.0, 10.0);
        field.agent.velocity = Vector2::new(3.0, 1.0);
        let obstacle = &mut field.obstacles[2];
        obstacle.velocity = Vector2::new(-2.0, 4.0);
        obstacle.ttc_s = 2.0;
        obstacle.linear = Vector2::new(110.0, 5.0);
        let last = obstacle.history.len() - 1;
        obstacle.history[last] = obstacle.linear;
        field
            .obstacles
            .iter_mut()
            .enumerate()
            .filter(|(index, _)| *index != 2)
            .for_each(|(_, o)| o.ttc_s = 1e6);
        field.advance(0.0);
        // The agent is at 10 + 1 * 2 = 12 m, the obstacle at 5 + 4 * 2 = 13 m.
        let [passing] = field.passings() else { panic!("{:?}", field.passings()) };
        assert_eq!((passing.obstacle, passing.wrong), (2, false), "right: the agent leaves it to port");
        assert!((passing.lateral_m + 1.0).abs() < 1e-9, "{}", passing.lateral_m);
        assert!((field.obstacles()[2].ttc_s + 3.0).abs() < 1e-12);
        field.advance(0.0);
        assert!(field.passings().is_empty(), "an obstacle is passed once");
    }
}
