//! Every constant of the coastal environment; the defaults are the paper's.

use serde::{Deserialize, Serialize};

use crate::scenario::encounter_starts::{HeadOnConfig, HeadOnKind};

/// Which head-on encounters are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScenarioChoice {
    /// Either, with equal probability.
    #[default]
    Both,
    /// Scenario 1: the target ship is about to turn to port and clear.
    BeforeCurve,
    /// Scenario 2: the target ship goes straight on.
    StraightOn,
}

impl ScenarioChoice {
    /// The scenarios to draw from.
    #[must_use]
    pub fn kinds(self) -> &'static [HeadOnKind] {
        match self {
            Self::Both => &[HeadOnKind::BeforeCurve, HeadOnKind::StraightOn],
            Self::BeforeCurve => &[HeadOnKind::BeforeCurve],
            Self::StraightOn => &[HeadOnKind::StraightOn],
        }
    }
}

/// Where the estimates of the recorded vessel's collision risk come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimateSource {
    /// A forecast from its history.
    #[default]
    Forecast,
    /// Its true future: tells an error of the forecast from one of the policy.
    Truth,
}

/// Constants of the environment (paper, section "Reinforcement learning environment").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CoastalConfig {
    /// Where encounters start, and own ship's speed, turn and time between decisions.
    pub head_on: HeadOnConfig,
    /// Which encounters are drawn.
    pub scenario: ScenarioChoice,
    /// Decisions per episode.
    pub decisions: usize,
    /// Standard deviation of own ship's disturbance on north and on east at the start, in metres.
    pub start_position_sd_m: f64,
    /// Own ship's heading at the start is disturbed by up to this much, to port, in degrees.
    pub start_heading_port_deg: f64,
    /// Further obstacles, which move in straight lines.
    pub linear_obstacles: usize,
    /// Standard deviation of their speed about own ship's, in metres per second.
    pub linear_speed_sd_mps: f64,
    /// Following traffic keeps within this of own ship's course, in degrees.
    pub following_course_deg: f64,
    /// Following traffic starts at least this far back, in metres.
    pub following_back_min_m: f64,
    /// Following traffic starts at most this far back, in metres.
    pub following_back_max_m: f64,
    /// Other traffic starts at least this far off in north and in east, in metres.
    pub other_offset_min_m: f64,
    /// Other traffic starts at most this far off in north and in east, in metres.
    pub other_offset_max_m: f64,
    /// Other traffic has at least this analytic DCPA, in metres.
    pub other_dcpa_min_m: f64,
    /// Centre distance at which collision circles touch, in metres; their radius is half of it.
    pub collision_distance_m: f64,
    /// Cross-track error to port from which on a decision is penalised, in metres.
    pub cross_track_limit_m: f64,
    /// Positions of history that the forecaster sees.
    pub history_positions: usize,
    /// Steps that the recorded vessel is forecast over.
    pub forecast_steps: usize,
    /// Decisions between two forecasts.
    pub forecast_every_decisions: usize,
    /// Where the estimates come from.
    pub estimates: EstimateSource,
    /// Standard deviation of the sensor noise on north and on east, in metres.
    pub noise_m: f64,
    /// Length of every hull, in metres; hulls are watched, not rewarded.
    pub vessel_length_m: f64,
    /// Beam of every hull, in metres.
    pub vessel_beam_m: f64,
    /// Scale of speeds in the observation, in metres per second.
    pub speed_scale_mps: f64,
    /// Scale of the cross-track error, in metres.
    pub cross_track_scale_m: f64,
    /// Scale of distances, in metres.
    pub distance_scale_m: f64,
    /// Scale of DCPA, in metres.
    pub dcpa_scale_m: f64,
    /// Scale of TCPA, in seconds.
    pub tcpa_scale_s: f64,
}

impl CoastalConfig {
    /// Obstacles in an episode: the recorded vessel and those that move in straight lines.
    #[must_use]
    pub fn obstacles(&self) -> usize {
        1 + self.linear_obstacles
    }

    /// Length of an observation with or without estimates.
    #[must_use]
    pub fn observation_len(&self, estimates: bool) -> usize {
        let per_obstacle = if estimates { 6 } else { 4 };
        2 + per_obstacle * self.obstacles()
    }

    /// Whether forecasts of recorded vessels are the same in every episode that comes by a sample: they are asked
    /// for, and what is shown to the forecaster is free of noise.
    #[must_use]
    pub fn forecasts_depend_on_tracks_alone(&self) -> bool {
        self.estimates == EstimateSource::Forecast && self.noise_m == 0.0
    }
}

impl Default for CoastalConfig {
    fn default() -> Self {
        Self {
            head_on: HeadOnConfig::default(),
            scenario: ScenarioChoice::default(),
            decisions: 15,
            start_position_sd_m: 1.0,
            start_heading_port_deg: 3.0,
            linear_obstacles: 3,
            linear_speed_sd_mps: 0.2,
            following_course_deg: 30.0,
            following_back_min_m: 500.0,
            following_back_max_m: 1000.0,
            other_offset_min_m: 1500.0,
            other_offset_max_m: 3000.0,
            other_dcpa_min_m: 800.0,
            collision_distance_m: 300.0,
            cross_track_limit_m: 200.0,
            history_positions: 75,
            forecast_steps: 200,
            forecast_every_decisions: 2,
            estimates: EstimateSource::default(),
            noise_m: 0.0,
            vessel_length_m: 100.0,
            vessel_beam_m: 18.0,
            speed_scale_mps: 5.0,
            cross_track_scale_m: 200.0,
            distance_scale_m: 3000.0,
            dcpa_scale_m: 100.0,
            tcpa_scale_s: 100.0,
        }
    }
}
