//! Head-on encounters with recorded vessels in coastal waters (paper, section "Reinforcement learning
//! environment" of the maritime study).
//!
//! Obstacle 1 replays a recorded track: in scenario 1 it is about to turn to port and clear, in scenario
//! 2 it goes straight on. Three more move in straight lines. Own ship changes its heading once every
//! 20 s; with the dynamics of KVLCC2 it changes the heading that its autopilot is to steer.
//!
//! | action | range | unit |
//! | --- | --- | --- |
//! | change of heading over its greatest value, positive to starboard | `[-1, 1]`, clipped | 2.4° |
//!
//! | observation | value | scale |
//! | --- | --- | --- |
//! | 0 | own speed | 5 m/s |
//! | 1 | cross-track error, positive to port of the undisturbed path | 200 m |
//! | 2 + 6 j | distance less 300 m | 3000 m |
//! | 3 + 6 j | relative bearing, `(-pi, pi]` | pi |
//! | 4 + 6 j | course of the obstacle less own heading, `(-pi, pi]` | pi |
//! | 5 + 6 j | speed of the obstacle | 5 m/s |
//! | 6 + 6 j | estimated DCPA less 300 m | 100 m |
//! | 7 + 6 j | estimated TCPA | 100 s |
//!
//! `j` counts obstacles by ascending estimated DCPA. Without estimates there are four values per
//! obstacle, sorted by distance. Ties go to the lower index. Sensor noise touches positions, and what is
//! computed from them, in the observation; rewards and contacts use the true ones.
//!
//! | reward term | value |
//! | --- | --- |
//! | `wrong_side` | -1 where the cross-track error is 200 m to port or more |
//! | `too_close` | minus the number of obstacles within 300 m |

mod config;
pub mod observation;
mod paths;
mod record;
mod situation;
mod traffic;

pub use config::{CoastalConfig, EstimateSource, ScenarioChoice};
pub use paths::{KnownPaths, LivePaths, Moment, Path, PathSource, TablePaths};
pub use traffic::{Opening, SensorNoise};

use std::collections::BTreeSet;
use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

use observation::{SensedObstacle, SensedOwn};

use super::{ActionError, Env, RewardTerm, Step, check_action};
use crate::config::Fault;
use crate::cpa::linear::closest_approach;
use crate::cpa::{Cpa, CpaConfig, Estimator, StraightMotion};
use crate::forecast::sample_table::Sample;
use crate::forecast::{Basis, Forecaster};
use crate::geo::Position;
use crate::scenario::encounter_starts::{HeadOnKind, HeadOnStart, HeadOnStarts};
use crate::track::Track;
use crate::vessel::{Command, Dynamics, Linear, Motion, Recorded, Steered, VesselState};
use crate::world::{Bow, Hull, HullError, PairReport, VesselBody, VesselId, World, WorldConfig};

/// Why there is no coastal environment.
#[derive(Debug, Error)]
pub enum CoastalError {
    /// The tracks offer no start of a scenario that is asked for.
    #[error(
        "none of the {tracks} track(s) offers a start of the scenario `{kind:?}`; take more tracks, another area, \
         or another `scenario`"
    )]
    NoStart {
        /// Tracks searched.
        tracks: usize,
        /// The scenario.
        kind: HeadOnKind,
    },
    /// A track is on another time grid than the first.
    #[error(
        "track {index} has positions {dt_s} s apart, the first {expected_s} s; import them with one step"
    )]
    TimeStep {
        /// Index of the track.
        index: usize,
        /// Its time step, in seconds.
        dt_s: f64,
        /// That of the first track.
        expected_s: f64,
    },
    /// The configured hull is none.
    #[error(transparent)]
    Hull(#[from] HullError),
    /// Own ship's dynamics cannot be.
    #[error("head_on.kvlcc2.{0}")]
    Dynamics(#[from] Fault),
}

/// The recorded vessels of an area and the starts found on their tracks; shared by many environments.
#[derive(Debug)]
pub struct RecordedTraffic {
    replays: Vec<Recorded>,
    starts: HeadOnStarts,
    dt_s: f64,
}

impl RecordedTraffic {
    /// Finds the starts on the tracks.
    ///
    /// # Errors
    ///
    /// When a scenario that `config` asks for has no start, tracks differ in their time step, or own ship's
    /// dynamics cannot be.
    pub fn new(tracks: Vec<Track>, config: &CoastalConfig) -> Result<Self, CoastalError> {
        config.head_on.check_dynamics()?;
        let starts = HeadOnStarts::find(&tracks, &config.head_on);
        Self::with_starts(tracks, starts, config)
    }

    /// The same with starts that were found on these tracks before.
    ///
    /// # Errors
    ///
    /// As [`Self::new`].
    pub fn with_starts(
        tracks: Vec<Track>,
        starts: HeadOnStarts,
        config: &CoastalConfig,
    ) -> Result<Self, CoastalError> {
        if let Some(&kind) = config.scenario.kinds().iter().find(|kind| starts.of(**kind).is_empty()) {
            return Err(CoastalError::NoStart { tracks: tracks.len(), kind });
        }
        let dt_s = tracks.first().map_or(0.0, |track| track.dt_s);
        if let Some(index) = tracks.iter().position(|track| track.dt_s != dt_s) {
            return Err(CoastalError::TimeStep { index, dt_s: tracks[index].dt_s, expected_s: dt_s });
        }
        let replays = tracks.into_iter().map(|track| Recorded::new(Arc::new(track), dt_s)).collect();
        Ok(Self { replays, starts, dt_s })
    }

    /// The starts.
    #[must_use]
    pub fn starts(&self) -> &HeadOnStarts {
        &self.starts
    }

    /// The tracks, in the order that starts refer to.
    pub fn tracks(&self) -> impl Iterator<Item = &Track> {
        self.replays.iter().map(Recorded::track)
    }

    /// Every sample at which an episode can ask for a forecast, for [`TablePaths`].
    #[must_use]
    pub fn forecast_samples(&self, config: &CoastalConfig) -> BTreeSet<Sample> {
        let per_decision = self.steps_per_decision(config);
        let starts = config.scenario.kinds().iter().flat_map(|kind| self.starts.of(*kind));
        let decisions = (0..=config.decisions).step_by(config.forecast_every_decisions.max(1));
        starts
            .flat_map(|start| decisions.clone().map(|n| (start.track, start.index + n * per_decision)))
            .collect()
    }

    /// Time steps from one decision to the next.
    #[must_use]
    pub fn steps_per_decision(&self, config: &CoastalConfig) -> usize {
        (config.head_on.decision_interval_s / self.dt_s).round().max(1.0) as usize
    }

    fn replay(&self, start: HeadOnStart) -> Recorded {
        self.replays[start.track].from_offset(start.index as f64 * self.dt_s)
    }
}

/// What happened in an episode so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// The scenario.
    pub kind: HeadOnKind,
    /// Whether collision circles touched at any time.
    pub contact: bool,
    /// Whether they touched at the time of a decision.
    pub contact_at_decision: bool,
    /// Whether the cross-track error reached its limit at the time of a decision.
    pub wrong_side: bool,
    /// Closest distance of centres at any time, in metres.
    pub closest_m: f64,
}

/// The environment.
pub struct Coastal {
    config: CoastalConfig,
    traffic: Arc<RecordedTraffic>,
    paths: Option<Box<dyn PathSource>>,
    estimator: Estimator,
    world: World,
    episode: Option<Episode>,
    states: Vec<VesselState>,
    /// Where the recorded vessel was last expected to go, and the time step at which.
    ahead: Option<(i64, Arc<[Position]>)>,
    estimates: Vec<Cpa>,
    terms: [RewardTerm; 2],
    fallbacks: u64,
    body: VesselBody,
    /// Every time step since the start, where they are kept.
    kept_steps: Option<Vec<record::Step>>,
}

/// The episode under way.
struct Episode {
    seed: u64,
    opening: Opening,
    own: Box<dyn Steered>,
    /// Where own ship has been, from the start on.
    own_path: Vec<Position>,
    recorded: Recorded,
    noise: SensorNoise,
    decision: usize,
    outcome: Outcome,
}

impl Episode {
    /// Time steps since the start.
    fn step(&self, steps_per_decision: usize) -> i64 {
        (self.decision * steps_per_decision) as i64
    }

    /// The true position of a vessel at a time step that is not in the future. Before the start own ship
    /// came straight on.
    fn position(&self, vessel: usize, step: i64) -> Position {
        match vessel {
            0 => match usize::try_from(step) {
                Ok(step) => self.own_path[step],
                Err(_) => self.opening.own_before.position(step),
            },
            1 => self.recorded.position(step),
            _ => self.opening.linear[vessel - 2].position(step),
        }
    }
}

impl Coastal {
    /// The environment. A forecaster makes estimates part of the observation; without one it is the
    /// baseline's.
    ///
    /// # Errors
    ///
    /// When the configured hull is none, or own ship's dynamics cannot be.
    pub fn new(
        config: CoastalConfig,
        traffic: Arc<RecordedTraffic>,
        forecaster: Option<Box<dyn Forecaster>>,
    ) -> Result<Self, CoastalError> {
        let noise_free = config.noise_m == 0.0;
        let live = |forecaster| -> Box<dyn PathSource> { Box::new(LivePaths::new(forecaster, noise_free)) };
        Self::with_paths(config, traffic, forecaster.map(live))
    }

    /// The environment with forecasts from any source; without one the observation is the baseline's.
    ///
    /// # Errors
    ///
    /// When the configured hull is none.
    pub fn with_paths(
        config: CoastalConfig,
        traffic: Arc<RecordedTraffic>,
        paths: Option<Box<dyn PathSource>>,
    ) -> Result<Self, CoastalError> {
        let body = VesselBody {
            hull: Hull::new(config.vessel_length_m, config.vessel_beam_m, Bow::default())?,
            collision_radius_m: config.collision_distance_m / 2.0,
        };
        let mut world = World::new(WorldConfig { dt_s: traffic.dt_s, ..WorldConfig::default() });
        let nowhere = VesselState::on_course(Position::ORIGIN, crate::angle::Nautical::NORTH, 0.0);
        let obstacles = 1 + config.linear_obstacles;
        let own_body = own_body(&config, &body)?;
        let bodies = std::iter::once(&own_body).chain(std::iter::repeat_n(&body, obstacles));
        let ids: Vec<VesselId> = bodies.map(|body| world.add_vessel(body.clone(), nowhere)).collect();
        for &obstacle in &ids[1..] {
            world.watch(ids[0], obstacle);
        }
        Ok(Self {
            estimator: Estimator::new(&CpaConfig { smoothing: 0, ..CpaConfig::default() }),
            traffic,
            paths,
            world,
            episode: None,
            states: Vec::new(),
            ahead: None,
            estimates: vec![Cpa::UNKNOWN; obstacles],
            terms: [
                RewardTerm { name: "wrong_side", value: 0.0 },
                RewardTerm { name: "too_close", value: 0.0 },
            ],
            fallbacks: 0,
            body,
            kept_steps: None,
            config,
        })
    }

    /// What happened in the episode so far; nothing before the first reset.
    #[must_use]
    pub fn outcome(&self) -> Option<Outcome> {
        self.episode.as_ref().map(|episode| episode.outcome)
    }

    /// How the episode started; nothing before the first reset.
    #[must_use]
    pub fn opening(&self) -> Option<&Opening> {
        self.episode.as_ref().map(|episode| &episode.opening)
    }

    /// What the last time step brought between own ship and each obstacle.
    #[must_use]
    pub fn reports(&self) -> &[PairReport] {
        self.world.reports()
    }

    /// True states: own ship, the recorded vessel, then the others.
    #[must_use]
    pub fn states(&self) -> &[VesselState] {
        &self.states
    }

    /// Estimates so far that rest on a straight line in place of a forecast.
    #[must_use]
    pub fn fallbacks(&self) -> u64 {
        self.fallbacks
    }

    fn steps_per_decision(&self) -> usize {
        self.traffic.steps_per_decision(&self.config)
    }

    fn read_states(states: &mut Vec<VesselState>, episode: &Episode, step: i64) {
        states.clear();
        states.push(episode.own.state());
        states.push(episode.recorded.state(step));
        states.extend(episode.opening.linear.iter().map(|linear: &Linear| linear.state(step)));
    }

    /// Cross-track error of a position, positive to port of the undisturbed path.
    fn cross_track_m(opening: &Opening, position: Position) -> f64 {
        -(position - opening.path.position).starboard_of_m(opening.path.course)
    }

    /// A vessel's position as its sensor gives it.
    fn sensed(&self, episode: &Episode, vessel: usize, step: i64, position: Position) -> Position {
        position + episode.noise.at(vessel, step) * self.config.noise_m
    }

    /// The latest positions of a vessel as sensed, oldest first, the present one last.
    fn sensed_history(&self, episode: &Episode, vessel: usize, step: i64) -> Vec<Position> {
        let first = step + 1 - self.config.history_positions as i64;
        (first..=step).map(|k| self.sensed(episode, vessel, k, episode.position(vessel, k))).collect()
    }

    /// The moments of an episode at which the recorded vessel is forecast, with its history as sensed.
    /// They do not depend on what own ship does.
    #[must_use]
    pub fn forecast_moments(&self, seed: u64) -> Vec<(Moment, Vec<Position>)> {
        let episode = self.draw(seed);
        (0..=self.config.decisions)
            .step_by(self.config.forecast_every_decisions.max(1))
            .map(|decision| {
                let step = (decision * self.steps_per_decision()) as i64;
                (self.moment(&episode, decision), self.sensed_history(&episode, 1, step))
            })
            .collect()
    }

    fn moment(&self, episode: &Episode, decision: usize) -> Moment {
        let HeadOnStart { track, index, .. } = episode.opening.start;
        let sample = (track, index + decision * self.steps_per_decision());
        Moment { seed: episode.seed, decision, sample }
    }

    fn estimate(&mut self, episode: &Episode) {
        if self.paths.is_none() {
            return;
        }
        let step = episode.step(self.steps_per_decision());
        let own = StraightMotion {
            position: self.sensed(episode, 0, step, self.states[0].position).xy(),
            velocity: self.states[0].velocity.xy(),
        };
        if episode.decision.is_multiple_of(self.config.forecast_every_decisions) {
            self.estimates[0] = self.estimate_recorded(episode, step, own);
        } else {
            self.estimates[0].time_s -= self.config.head_on.decision_interval_s;
        }
        for vessel in 2..self.states.len() {
            let position = self.sensed(episode, vessel, step, self.states[vessel].position).xy();
            let velocity = self.states[vessel].velocity.xy();
            self.estimates[vessel - 1] = closest_approach(own.position, own.velocity, position, velocity);
        }
    }

    /// The CPA with the recorded vessel: observed positions and those that follow in one row.
    fn estimate_recorded(&mut self, episode: &Episode, step: i64, own: StraightMotion) -> Cpa {
        let history = self.sensed_history(episode, 1, step);
        let path = match self.config.estimates {
            EstimateSource::Truth => {
                let (_, last) = episode.recorded.covered_steps();
                let last = last.min(step + self.config.forecast_steps as i64);
                Some((step + 1..=last).map(|k| episode.recorded.position(k)).collect())
            }
            EstimateSource::Forecast => self.forecast(episode, &history),
        };
        self.ahead = path.map(|path| (step, path));
        let Some((_, path)) = &self.ahead else {
            // Fewer than two finite positions: the present course and speed stand in.
            self.fallbacks += 1;
            let position = self.sensed(episode, 1, step, self.states[1].position).xy();
            return closest_approach(own.position, own.velocity, position, self.states[1].velocity.xy());
        };
        let now = history.len() - 1;
        let row = history.iter().chain(path.iter()).map(|position| position.xy());
        self.estimator.estimate(own, row, now, self.traffic.dt_s).cpa
    }

    fn forecast(&mut self, episode: &Episode, history: &[Position]) -> Option<Arc<[Position]>> {
        let moment = self.moment(episode, episode.decision);
        let path = self.paths.as_mut()?.path(moment, history, self.config.forecast_steps)?;
        self.fallbacks += u64::from(path.basis != Basis::Model);
        Some(path.positions)
    }

    fn observe(&self, episode: &Episode, observation: &mut [f32]) {
        let step = episode.step(self.steps_per_decision());
        let own = self.states[0];
        let position = self.sensed(episode, 0, step, own.position);
        let own = SensedOwn {
            position,
            heading: own.heading,
            speed_mps: own.velocity.speed_mps(),
            cross_track_m: Self::cross_track_m(&episode.opening, position),
        };
        let obstacles: Vec<SensedObstacle> = (1..self.states.len())
            .map(|vessel| SensedObstacle {
                position: self.sensed(episode, vessel, step, self.states[vessel].position),
                velocity: self.states[vessel].velocity,
                estimate: self.paths.is_some().then(|| self.estimates[vessel - 1]),
            })
            .collect();
        observation::observe(&self.config, &own, &obstacles, observation);
    }

    /// An episode at its start.
    fn draw(&self, seed: u64) -> Episode {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let traffic = &self.traffic;
        let state_of = |start: HeadOnStart| {
            let replay = &traffic.replays[start.track];
            (replay.track().positions[start.index], replay.track().velocity(start.index))
        };
        let opening = Opening::draw(&self.config, &traffic.starts, traffic.dt_s, state_of, &mut rng);
        // Starts of every scenario asked for were there when the traffic was loaded.
        let opening = opening.expect("a start of each scenario that is asked for");
        let own = self.config.head_on.launch_own(opening.own_position, opening.own_heading);
        let steps = self.config.decisions * self.steps_per_decision();
        let vessels = 2 + self.config.linear_obstacles;
        let noise = SensorNoise::draw(seed, vessels, self.config.history_positions, steps);
        let outcome = Outcome {
            kind: opening.kind,
            contact: false,
            contact_at_decision: false,
            wrong_side: false,
            closest_m: f64::INFINITY,
        };
        let recorded = traffic.replay(opening.start);
        let own_path = vec![opening.own_position];
        Episode { seed, own, own_path, recorded, noise, decision: 0, outcome, opening }
    }

    /// Moves on by one time step and notes what the world reports.
    fn advance(&mut self, episode: &mut Episode, step: i64) {
        episode.own.advance(self.traffic.dt_s);
        episode.own_path.push(episode.own.state().position);
        Self::read_states(&mut self.states, episode, step);
        for report in self.world.step(&self.states) {
            episode.outcome.contact |= report.circles_touch();
            episode.outcome.closest_m = episode.outcome.closest_m.min(report.min_centre_distance_m);
        }
        self.keep_step(episode, step);
    }
}

/// Own ship's shapes: a ship with dynamics of its own has their hull.
fn own_body(config: &CoastalConfig, body: &VesselBody) -> Result<VesselBody, CoastalError> {
    let head_on = &config.head_on;
    match head_on.dynamics {
        Dynamics::Kinematic => Ok(body.clone()),
        Dynamics::Kvlcc2 => {
            head_on.check_dynamics()?;
            let ship = head_on.kvlcc2.ship();
            Ok(VesselBody { hull: Hull::new(ship.length_m, ship.beam_m, Bow::Full)?, ..body.clone() })
        }
    }
}

impl Env for Coastal {
    fn observation_len(&self) -> usize {
        self.config.observation_len(self.paths.is_some())
    }

    fn action_len(&self) -> usize {
        1
    }

    fn max_decisions(&self) -> usize {
        self.config.decisions
    }

    fn reset(&mut self, seed: u64, observation: &mut [f32]) {
        let episode = self.draw(seed);
        self.ahead = None;
        Self::read_states(&mut self.states, &episode, 0);
        self.world.reset(&self.states);
        for term in &mut self.terms {
            term.value = 0.0;
        }
        self.estimate(&episode);
        self.observe(&episode, observation);
        if let Some(steps) = &mut self.kept_steps {
            steps.clear();
        }
        self.keep_step(&episode, 0);
        self.episode = Some(episode);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Result<Step, ActionError> {
        check_action(action, 1)?;
        let Some(mut episode) = self.episode.take_if(|episode| episode.decision < self.config.decisions)
        else {
            return Err(ActionError::EpisodeOver);
        };
        let turn_rad = f64::from(action[0].clamp(-1.0, 1.0)) * episode.own.max_turn_rad();
        episode.own.order(Command { turn_rad, speed_mps: None });
        let first = episode.step(self.steps_per_decision());
        for step in 1..=self.steps_per_decision() as i64 {
            self.advance(&mut episode, first + step);
        }
        episode.decision += 1;

        let own = self.states[0].position;
        let wrong_side = Self::cross_track_m(&episode.opening, own) >= self.config.cross_track_limit_m;
        let within =
            |state: &&VesselState| own.distance_m(state.position) <= self.config.collision_distance_m;
        let too_close = self.states[1..].iter().filter(within).count();
        episode.outcome.wrong_side |= wrong_side;
        episode.outcome.contact_at_decision |= too_close > 0;
        self.terms[0].value = if wrong_side { -1.0 } else { 0.0 };
        self.terms[1].value = -(too_close as f64);

        self.estimate(&episode);
        self.keep_path_ahead(episode.step(self.steps_per_decision()));
        self.observe(&episode, observation);
        let truncated = episode.decision == self.config.decisions;
        self.episode = Some(episode);
        let reward = self.terms.iter().map(|term| term.value).sum();
        Ok(Step { reward, terminated: false, truncated })
    }

    fn reward_terms(&self) -> &[RewardTerm] {
        &self.terms
    }
}

#[cfg(test)]
mod tests;
