//! A trained coastal agent at the helm: it observes the situation as its environment would have shown it.
//!
//! What differs from its training:
//!
//! - **More target ships** than it was trained with: it sees the nearest ones.
//! - **Fewer**: each place left is taken by a ship that is in nobody's way, dead astern at the greatest offset of
//!   traffic in training, on own ship's course at own ship's speed.
//! - **Estimates.** Where the situation brings forecasts of target ships, those are used, and the straight-line closed form
//!   for the others. Where it brings none, the agent's own forecaster forecasts every target ship whose history is
//!   complete. Without a forecaster all estimates are of the closed form.
//!
//! The turn is that of its training, as far as own ship can turn in one command.

use std::fmt;

use thiserror::Error;

use super::{Policy, Situation, TargetShip};
use crate::agent::TrainedAgent;
use crate::cpa::linear::closest_approach;
use crate::cpa::{Cpa, CpaConfig, Estimator, StraightMotion};
use crate::env::EnvName;
use crate::env::coastal::CoastalConfig;
use crate::env::coastal::observation::{SensedObstacle, SensedOwn, observe};
use crate::forecast::{Basis, Forecaster, Forecasts};
use crate::geo::{Displacement, Position};
use crate::nn::Compute;
use crate::rl::agent::{Agent, Memory};
use crate::vessel::Command;

/// Why an agent cannot steer own ship.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UnfitAgent {
    /// It was trained in another kind of waters.
    #[error(
        "the agent \"{name}\" was trained in open water with passing rules and steers by lateral acceleration; name an \
         agent of the coastal environment"
    )]
    OpenWater {
        /// The agent.
        name: String,
    },
    /// It decides at another pace.
    #[error(
        "the agent \"{name}\" was trained to decide every {trained_s} s, which is no multiple of the {given_s} s between \
         decisions here; set `decision_interval_s` of own ship to {trained_s}, or to a whole part of it"
    )]
    DecisionInterval {
        /// The agent.
        name: String,
        /// Time between two decisions in training, in seconds.
        trained_s: f64,
        /// Time between two decisions here, in seconds.
        given_s: f64,
    },
}

/// A trained agent as a policy.
pub struct TrainedPolicy {
    name: String,
    config: CoastalConfig,
    has_estimates: bool,
    agent: Agent,
    memory: Memory,
    compute: Compute,
    forecaster: Option<Box<dyn Forecaster>>,
    forecasts: Forecasts,
    estimator: Estimator,
    /// Estimates of the target ships, in their order.
    estimates: Vec<Cpa>,
    /// Whether each was taken from a forecast, and is held until the next.
    is_forecast: Vec<bool>,
    decisions: usize,
}

impl fmt::Debug for TrainedPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TrainedPolicy").field("name", &self.name).finish_non_exhaustive()
    }
}

impl TrainedPolicy {
    /// With the agent's own forecaster, for situations that bring no forecasts.
    ///
    /// # Errors
    ///
    /// When the agent is not of the coastal environment.
    pub fn new(agent: TrainedAgent, forecaster: Option<Box<dyn Forecaster>>) -> Result<Self, UnfitAgent> {
        let TrainedAgent { name, config, agent, .. } = agent;
        if config.env != EnvName::Coastal {
            return Err(UnfitAgent::OpenWater { name });
        }
        let memory = Memory::new(config.observation_len(), agent.config().history_len);
        Ok(Self {
            name,
            has_estimates: config.estimates,
            config: config.coastal,
            agent,
            memory,
            compute: Compute::new(1),
            forecaster,
            forecasts: Forecasts::new(),
            estimator: Estimator::new(&CpaConfig { smoothing: 0, ..CpaConfig::default() }),
            estimates: Vec::new(),
            is_forecast: Vec::new(),
            decisions: 0,
        })
    }

    /// Whether the agent can decide at the pace of its training where own ship takes orders at this one.
    ///
    /// # Errors
    ///
    /// When its own is no multiple of it.
    pub fn check_pace(&self, decision_s: f64) -> Result<(), UnfitAgent> {
        let trained_s = self.config.head_on.decision_interval_s;
        let every = (trained_s / decision_s).round();
        if every >= 1.0 && (every * decision_s - trained_s).abs() < 1e-9 {
            return Ok(());
        }
        Err(UnfitAgent::DecisionInterval { name: self.name.clone(), trained_s, given_s: decision_s })
    }

    /// What the agent observes of a situation.
    fn observation(&mut self, situation: &Situation<'_>) -> Vec<f32> {
        if self.has_estimates {
            self.estimate(situation);
        }
        let own = &situation.own;
        let sensed_own = SensedOwn {
            position: own.position,
            heading: own.heading,
            speed_mps: own.velocity.speed_mps(),
            cross_track_m: situation.route.cross_track_error_m(own.position),
        };
        let mut obstacles: Vec<SensedObstacle> = situation
            .targets
            .iter()
            .enumerate()
            .map(|(index, target)| SensedObstacle {
                position: target.position,
                velocity: target.velocity,
                estimate: self.has_estimates.then(|| self.estimates[index]),
            })
            .collect();
        self.fill_places(situation, &mut obstacles);
        let mut observation = vec![0.0; self.config.observation_len(self.has_estimates)];
        observe(&self.config, &sensed_own, &obstacles, &mut observation);
        observation
    }

    /// Brings the obstacles to the number that the agent was trained with.
    fn fill_places(&self, situation: &Situation<'_>, obstacles: &mut Vec<SensedObstacle>) {
        let own = &situation.own;
        let places = self.config.obstacles();
        if obstacles.len() > places {
            let range_m = |obstacle: &SensedObstacle| obstacle.position.distance_m(own.position);
            let mut nearest: Vec<usize> = (0..obstacles.len()).collect();
            nearest.sort_by(|&a, &b| range_m(&obstacles[a]).total_cmp(&range_m(&obstacles[b])));
            nearest.truncate(places);
            nearest.sort_unstable();
            *obstacles = nearest.into_iter().map(|index| obstacles[index]).collect();
        }
        let astern_m = self.config.other_offset_max_m;
        let nobody = SensedObstacle {
            position: own.position - Displacement::towards(own.velocity.course(), astern_m),
            velocity: own.velocity,
            estimate: self.has_estimates.then_some(Cpa { distance_m: astern_m, time_s: 0.0 }),
        };
        obstacles.resize(places, nobody);
    }

    /// Forecast-based estimates at every so many decisions, held and counted down in between; the closed form
    /// for all others at every decision.
    fn estimate(&mut self, situation: &Situation<'_>) {
        let count = situation.targets.len();
        let is_due = self.decisions.is_multiple_of(self.config.forecast_every_decisions);
        if is_due || self.estimates.len() != count {
            self.estimates = vec![Cpa::UNKNOWN; count];
            self.is_forecast = vec![false; count];
            self.estimate_by_forecast(situation);
        } else {
            for estimate in &mut self.estimates {
                estimate.time_s -= situation.decision_s;
            }
        }
        let own = &situation.own;
        for (index, target) in situation.targets.iter().enumerate() {
            if !self.is_forecast[index] {
                self.estimates[index] = closest_approach(
                    own.position.xy(),
                    own.velocity.xy(),
                    target.position.xy(),
                    target.velocity.xy(),
                );
            }
        }
    }

    fn estimate_by_forecast(&mut self, situation: &Situation<'_>) {
        if situation.targets.iter().any(|target| target.forecast.is_some()) {
            for (index, target) in situation.targets.iter().enumerate() {
                if let Some(path) = target.forecast {
                    self.take_estimate(index, situation, target, path);
                }
            }
            return;
        }
        let Some(forecaster) = &mut self.forecaster else { return };
        let length = forecaster.history_len();
        let is_complete = |target: &TargetShip<'_>| {
            let history = target.history;
            history.len() >= length && history[history.len() - length..].iter().all(|at| at.is_finite())
        };
        let complete: Vec<usize> =
            (0..situation.targets.len()).filter(|&index| is_complete(&situation.targets[index])).collect();
        let histories: Vec<&[Position]> =
            complete.iter().map(|&index| situation.targets[index].history).collect();
        let mut forecasts = std::mem::take(&mut self.forecasts);
        if forecaster.forecast(&histories, self.config.forecast_steps, &mut forecasts).is_ok() {
            for (path, &index) in complete.iter().enumerate() {
                if forecasts.basis(path) == Basis::Model {
                    self.take_estimate(index, situation, &situation.targets[index], forecasts.path(path));
                }
            }
        }
        self.forecasts = forecasts;
    }

    /// The CPA with a forecast target ship: observed positions and those that follow in one row.
    fn take_estimate(
        &mut self,
        index: usize,
        situation: &Situation<'_>,
        target: &TargetShip<'_>,
        path: &[Position],
    ) {
        let seen = target.history.len().saturating_sub(self.config.history_positions);
        let history = &target.history[seen..];
        let Some(now) = history.len().checked_sub(1) else { return };
        let row = history.iter().chain(path).map(|position| position.xy());
        let own = &situation.own;
        let own = StraightMotion { position: own.position.xy(), velocity: own.velocity.xy() };
        self.estimates[index] = self.estimator.estimate(own, row, now, situation.dt_s).cpa;
        self.is_forecast[index] = true;
    }
}

impl Policy for TrainedPolicy {
    fn name(&self) -> &str {
        &self.name
    }

    fn decision_interval_s(&self) -> Option<f64> {
        Some(self.config.head_on.decision_interval_s)
    }

    fn reset(&mut self, _seed: u64) {
        self.memory.clear();
        self.estimates.clear();
        self.is_forecast.clear();
        self.decisions = 0;
    }

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let observation = self.observation(situation);
        let mut action = [0.0];
        self.agent.act(&mut self.compute, &observation, &self.memory, &mut action);
        self.memory.push(&observation);
        self.decisions += 1;
        let trained_rad = self.config.head_on.turn_per_decision_deg.to_radians();
        let max_rad = situation.own.max_turn_rad;
        let turn_rad = f64::from(action[0].clamp(-1.0, 1.0)) * trained_rad;
        Command { turn_rad: turn_rad.clamp(-max_rad, max_rad), speed_mps: None }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::agent::RunConfig;
    use crate::angle::Nautical;
    use crate::env::Env;
    use crate::env::coastal::{Coastal, RecordedTraffic, ScenarioChoice};
    use crate::forecast::LinearForecaster;
    use crate::geo::Velocity;
    use crate::policy::{OwnShip, Route};
    use crate::track::{Track, VesselParticulars};

    fn agent(env: EnvName, estimates: bool) -> TrainedAgent {
        let mut config = RunConfig { estimates, ..RunConfig::of(env) };
        config.trainer.agent.hidden = 8;
        let rng = &mut ChaCha8Rng::seed_from_u64(3);
        let learner = Agent::new(config.trainer.agent.clone(), config.observation_len(), 1, rng);
        TrainedAgent { name: "some".into(), config, step: 0, mean_return: 0.0, agent: learner }
    }

    fn policy(estimates: bool, forecaster: Option<Box<dyn Forecaster>>) -> TrainedPolicy {
        TrainedPolicy::new(agent(EnvName::Coastal, estimates), forecaster).unwrap()
    }

    fn own() -> OwnShip<'static> {
        OwnShip {
            position: Position::ORIGIN,
            velocity: Velocity { north_mps: 8.0, east_mps: 0.0 },
            heading: Nautical::NORTH,
            ordered_heading: Nautical::NORTH,
            max_turn_rad: 1.0_f64.to_radians(),
            planned_speed_mps: 8.0,
            max_speed_change_mps: 0.0,
            history: &[],
        }
    }

    fn target<'a>(east_m: f64, history: &'a [Position], forecast: Option<&'a [Position]>) -> TargetShip<'a> {
        TargetShip {
            position: Position { north_m: 2000.0, east_m },
            velocity: Velocity { north_mps: -8.0, east_mps: 0.0 },
            history,
            forecast,
            collision_distance_m: 300.0,
        }
    }

    fn with<R>(targets: &[TargetShip<'_>], see: impl FnOnce(&Situation<'_>) -> R) -> R {
        let route = Route::straight(Position::ORIGIN, Nautical::NORTH);
        let own = own();
        see(&Situation { time_s: 0.0, dt_s: 5.0, decision_s: 20.0, own, route: &route, targets })
    }

    /// DCPA and TCPA of every place, in metres and seconds.
    fn estimates_seen(observation: &[f32]) -> Vec<(f64, f64)> {
        let of = |place: &[f32]| (f64::from(place[4]) * 100.0 + 300.0, f64::from(place[5]) * 100.0);
        observation[2..].chunks(6).map(of).collect()
    }

    #[test]
    fn places_without_a_ship_hold_one_that_is_in_nobodys_way() {
        let mut policy = policy(true, None);
        let observation = with(&[target(0.0, &[], None)], |situation| policy.observation(situation));
        let seen = estimates_seen(&observation);
        assert!(seen[0].0.abs() < 1e-3 && (seen[0].1 - 125.0).abs() < 1e-3, "head-on at 16 m/s: {seen:?}");
        for place in observation[8..].chunks(6) {
            // Dead astern, on own course, at own speed, and never closer than it is.
            assert_eq!(place, [0.9, 1.0, 0.0, 1.6, 27.0, 0.0]);
        }
    }

    #[test]
    fn of_too_many_ships_the_nearest_are_seen() {
        let ships: Vec<_> =
            [900.0, 100.0, 5000.0, 300.0, -700.0, 0.0].map(|east_m| target(east_m, &[], None)).into();
        let mut policy = policy(false, None);
        let all = with(&ships, |situation| policy.observation(situation));
        let nearest = [ships[1], ships[3], ships[4], ships[5]];
        assert_eq!(all, with(&nearest, |situation| policy.observation(situation)));
    }

    /// A forecast that stops the target ship 1000 m ahead: own ship on its present velocity meets it after 125 s.
    #[test]
    fn given_forecasts_are_used_held_and_counted_down() {
        let history = [Position { north_m: 2040.0, east_m: 0.0 }, Position { north_m: 2000.0, east_m: 0.0 }];
        let path = vec![Position { north_m: 1000.0, east_m: 500.0 }; 200];
        let ships = [target(0.0, &history, Some(&path))];
        let mut policy = policy(true, None);
        let mut next = || {
            let observation = with(&ships, |situation| policy.observation(situation));
            policy.decisions += 1;
            estimates_seen(&observation)[0]
        };
        let first = next();
        assert!((first.0 - 500.0).abs() < 0.1 && (first.1 - 125.0).abs() < 0.1, "{first:?}");
        let held = next();
        assert!((held.0 - first.0).abs() < 1e-3 && (held.1 - (first.1 - 20.0)).abs() < 1e-3, "{held:?}");
        assert_eq!(next(), first, "every second decision anew");
    }

    /// Histories that tell another speed than the velocity: the closed form does not see it, a forecast does.
    #[test]
    fn complete_histories_are_forecast_by_the_agents_own_forecaster() {
        let slow: Vec<Position> =
            (0..75).map(|k| Position { north_m: 2000.0 + 10.0 * f64::from(74 - k), east_m: 0.0 }).collect();
        let forecaster = || -> Option<Box<dyn Forecaster>> { Some(Box::new(LinearForecaster::over(75))) };
        let seen = |history: &[Position], forecaster: Option<Box<dyn Forecaster>>| {
            let mut policy = policy(true, forecaster);
            let observation = with(&[target(0.0, history, None)], |situation| policy.observation(situation));
            estimates_seen(&observation)[0].1
        };
        // Its positions say 2 m/s, its velocity 8 m/s.
        assert!((seen(&slow, forecaster()) - 200.0).abs() < 0.1);
        assert!((seen(&slow, None) - 125.0).abs() < 0.1);
        assert!((seen(&slow[1..], forecaster()) - 125.0).abs() < 0.1, "an incomplete history");
    }

    #[test]
    fn the_turn_is_that_of_training_as_far_as_own_ship_can_turn() {
        let mut policy = policy(false, None);
        let ships = [target(0.0, &[], None)];
        policy.reset(0);
        let first = with(&ships, |situation| policy.decide(situation));
        assert!(first.turn_rad.abs() <= 1.0_f64.to_radians() && first.turn_rad != 0.0);
        let second = with(&ships, |situation| policy.decide(situation));
        assert_ne!(first, second, "it remembers what it saw");
        policy.reset(0);
        assert_eq!(with(&ships, |situation| policy.decide(situation)), first);
    }

    #[test]
    fn agents_that_do_not_fit_are_told() {
        let error = TrainedPolicy::new(agent(EnvName::OpenWater, false), None).unwrap_err();
        assert!(error.to_string().contains("open water"), "{error}");
        let policy = policy(false, None);
        assert_eq!(policy.check_pace(20.0), Ok(()));
        assert_eq!(policy.check_pace(10.0), Ok(()));
        let error = policy.check_pace(15.0).unwrap_err().to_string();
        assert!(error.contains("every 20 s") && error.contains("`decision_interval_s`"), "{error}");
    }

    /// In an episode of its environment the policy sees what the environment shows, to the bit, noise and held
    /// estimates included.
    #[test]
    fn it_observes_what_its_environment_would_show() {
        let way = Displacement { north_m: 50.0, east_m: 0.0 };
        let positions = (0..600).map(|k| Position::ORIGIN + way * f64::from(k)).collect();
        let particulars = VesselParticulars::default();
        let track = Track { mmsi: 1, start_unix_s: 0, dt_s: 5.0, positions, particulars };
        for estimates in [true, false] {
            let trained = agent(EnvName::Coastal, estimates);
            let mut config = trained.config.coastal.clone();
            config.scenario = ScenarioChoice::StraightOn;
            config.noise_m = 10.0;
            let traffic = Arc::new(RecordedTraffic::new(vec![track.clone()], &config).unwrap());
            let forecaster = || -> Box<dyn Forecaster> { Box::new(LinearForecaster::over(75)) };
            let mut env = Coastal::new(config, traffic, estimates.then(forecaster)).unwrap();
            let mut policy = TrainedPolicy::new(trained, None).unwrap();
            let mut observation = vec![0.0; env.observation_len()];
            for seed in 0..5 {
                env.reset(seed, &mut observation);
                policy.reset(seed);
                for _ in 0..env.max_decisions() {
                    let action = env.ask(&mut policy).unwrap();
                    let past = policy.memory.history();
                    let last = (past.lengths[0] - 1) * observation.len();
                    assert_eq!(&past.observations[last..][..observation.len()], observation);
                    env.step(&[action], &mut observation).unwrap();
                }
            }
        }
    }
}
