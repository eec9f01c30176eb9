//! Every constant of the open-water environment; the defaults are the paper's.

use serde::{Deserialize, Serialize};

use crate::cpa::CpaMethod;
use crate::vessel::{PeriodicConfig, StochasticConfig};

/// How the obstacles leave their straight lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum MotionKind {
    /// A smoothed autoregressive wander.
    #[default]
    Stochastic,
    /// A sine across the course, with noise.
    Periodic,
}

/// Constants of the environment (paper, tables "Environment parameters" and section "Training
/// environment").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OpenWaterConfig {
    /// Time step, in seconds.
    pub dt_s: f64,
    /// Decisions per episode.
    pub decisions: usize,
    /// Obstacles per passing rule; half of all.
    pub obstacles_per_rule: usize,
    /// Slowest longitudinal speed of the agent, in metres per second.
    pub agent_speed_min_mps: f64,
    /// Greatest speed `v_max` of the agent, longitudinal and lateral, in metres per second.
    pub agent_speed_max_mps: f64,
    /// Greatest lateral acceleration `a_y,max`, in metres per second squared.
    pub agent_acceleration_max_mps2: f64,
    /// Greatest value of either velocity component of an obstacle, in metres per second.
    pub obstacle_speed_max_mps: f64,
    /// Greatest spacing of the time to collision of a new obstacle, in seconds.
    pub ttc_spacing_max_s: f64,
    /// Mean `mu_dy` of an obstacle's distance from the desired path when it is passed, in metres.
    pub path_distance_mean_m: f64,
    /// Its standard deviation `sigma_dy`, in metres.
    pub path_distance_sd_m: f64,
    /// Its lower bound `dy_min`, in metres.
    pub path_distance_min_m: f64,
    /// Autoregression `phi_traj` of the desired path.
    pub path_phi: f64,
    /// Variance `sigma_traj^2` of its innovations, in square metres.
    pub path_innovation_variance_m2: f64,
    /// Smoothing factor `beta_traj`.
    pub path_beta: f64,
    /// Steps by which the desired path begins before the episode.
    pub path_lead_steps: usize,
    /// Steps by which it goes on after the episode.
    pub path_trail_steps: usize,
    /// Kind of the obstacles' motion.
    pub motion: MotionKind,
    /// Constants of the stochastic motion.
    pub stochastic: StochasticConfig,
    /// Constants of the periodic motion.
    pub periodic: PeriodicConfig,
    /// How estimates are taken from a forecast.
    pub cpa: CpaMethod,
    /// Steps `T` that obstacles are forecast, and backcast, over.
    pub forecast_steps: usize,
    /// Half-width `n` of the moving average over distances.
    pub smoothing_half_width: usize,
    /// Steps between two estimates of one obstacle.
    pub estimate_every_steps: usize,
    /// Scale of positions in the observation, in metres.
    pub position_scale_m: f64,
    /// Length of every vessel's hull, in metres; hulls and circles are watched, not rewarded.
    pub vessel_length_m: f64,
    /// Beam of every vessel's hull, in metres.
    pub vessel_beam_m: f64,
    /// Radius of every vessel's collision circle, in metres.
    pub collision_radius_m: f64,
    /// Scale of DCPA in the observation, in metres.
    pub dcpa_scale_m: f64,
    /// Scale of TCPA in the observation, in seconds.
    pub tcpa_scale_s: f64,
}

impl OpenWaterConfig {
    /// Length of an observation with or without estimates.
    #[must_use]
    pub fn observation_len(&self, estimates: bool) -> usize {
        let per_obstacle = if estimates { 4 } else { 2 };
        3 + per_obstacle * 2 * self.obstacles_per_rule
    }
}

impl Default for OpenWaterConfig {
    fn default() -> Self {
        Self {
            dt_s: 5.0,
            decisions: 500,
            obstacles_per_rule: 5,
            agent_speed_min_mps: 1.0,
            agent_speed_max_mps: 5.0,
            agent_acceleration_max_mps2: 0.01,
            obstacle_speed_max_mps: 5.0,
            ttc_spacing_max_s: 300.0,
            path_distance_mean_m: 100.0,
            path_distance_sd_m: 50.0,
            path_distance_min_m: 40.0,
            path_phi: 0.99,
            path_innovation_variance_m2: 800.0,
            path_beta: 0.03,
            path_lead_steps: 60,
            path_trail_steps: 300,
            motion: MotionKind::default(),
            stochastic: StochasticConfig::default(),
            periodic: PeriodicConfig::default(),
            cpa: CpaMethod::default(),
            forecast_steps: 100,
            smoothing_half_width: 10,
            estimate_every_steps: 10,
            position_scale_m: 3000.0,
            vessel_length_m: 20.0,
            vessel_beam_m: 5.0,
            collision_radius_m: 20.0,
            dcpa_scale_m: 400.0,
            tcpa_scale_s: 300.0,
        }
    }
}
