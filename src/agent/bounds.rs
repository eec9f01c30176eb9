//! What the numbers of a run's settings can be.

use super::RunConfig;
use crate::config::bounds::{COUNT, FRACTION, HELD, POSITIVE, SIZE, SOME, STEP_S};
use crate::config::{BoundedNumber, Fault, check_bounds};
use crate::env::coastal::CoastalConfig;
use crate::env::open_water::OpenWaterConfig;
use crate::rl::agent::AgentConfig;
use crate::rl::sac::SacConfig;
use crate::rl::td3::Td3Config;
use crate::rl::trainer::TrainerConfig;
use crate::scenario::encounter_starts::HeadOnConfig;

const HALF_TURN_DEG: [f64; 2] = [0.0, 180.0];

impl RunConfig {
    /// Checks that every number can be worked with.
    ///
    /// # Errors
    ///
    /// The first that cannot, and what to write instead.
    pub fn check(&self) -> Result<(), Fault> {
        for (table, numbers) in self.numbers() {
            check_bounds(numbers).map_err(|fault| fault.within(table))?;
        }
        self.check_order()?;
        self.coastal.head_on.check_dynamics().map_err(|fault| fault.within("coastal.head_on.kvlcc2"))
    }

    /// Every number of every table.
    fn numbers(&self) -> [(&'static str, Vec<BoundedNumber>); 11] {
        let Self { open_water, coastal, trainer, .. } = self;
        let agent = &trainer.agent;
        [
            ("", vec![("steps", self.steps as f64, SOME)]),
            ("open_water", open_water_numbers(open_water)),
            ("open_water.stochastic", open_water.stochastic.numbers()),
            ("open_water.periodic", open_water.periodic.numbers()),
            ("coastal", coastal_numbers(coastal)),
            ("coastal.head_on", head_on_numbers(&coastal.head_on)),
            ("tracks.split", self.tracks.split.numbers()),
            ("trainer", trainer_numbers(trainer)),
            ("trainer.agent", agent_numbers(agent)),
            ("trainer.agent.td3", td3_numbers(&agent.td3)),
            ("trainer.agent.sac", sac_numbers(&agent.sac)),
        ]
    }

    /// Checks that no range is upside down.
    fn check_order(&self) -> Result<(), Fault> {
        let Self { open_water, coastal, trainer, .. } = self;
        let ranges = [
            (
                "open_water.agent_speed_min_mps",
                [open_water.agent_speed_min_mps, open_water.agent_speed_max_mps],
                "agent_speed_max_mps",
            ),
            (
                // The moving average needs a window that fits into forecast and backcast.
                "open_water.smoothing_half_width",
                [open_water.smoothing_half_width as f64, open_water.forecast_steps as f64],
                "forecast_steps",
            ),
            (
                "coastal.following_back_min_m",
                [coastal.following_back_min_m, coastal.following_back_max_m],
                "following_back_max_m",
            ),
            (
                "coastal.other_offset_min_m",
                [coastal.other_offset_min_m, coastal.other_offset_max_m],
                "other_offset_max_m",
            ),
            (
                "coastal.head_on.speed_min_mps",
                [coastal.head_on.speed_min_mps, coastal.head_on.speed_max_mps],
                "speed_max_mps",
            ),
            (
                "trainer.agent.sac.log_sd_min",
                [trainer.agent.sac.log_sd_min, trainer.agent.sac.log_sd_max],
                "log_sd_max",
            ),
        ];
        match ranges.into_iter().find(|(_, [least, most], _)| least > most) {
            Some((key, [least, most], other)) => {
                let message = format!("{least} is above {other}, which is {most}");
                Err(Fault::new(key, message, "write a smaller number, or raise the other"))
            }
            None => Ok(()),
        }
    }
}

fn open_water_numbers(config: &OpenWaterConfig) -> Vec<BoundedNumber> {
    vec![
        ("dt_s", config.dt_s, STEP_S),
        ("decisions", config.decisions as f64, SOME),
        ("obstacles_per_rule", config.obstacles_per_rule as f64, [1.0, 1000.0]),
        ("agent_speed_min_mps", config.agent_speed_min_mps, SIZE),
        ("agent_speed_max_mps", config.agent_speed_max_mps, POSITIVE),
        ("agent_acceleration_max_mps2", config.agent_acceleration_max_mps2, [1e-6, 1e3]),
        ("obstacle_speed_max_mps", config.obstacle_speed_max_mps, POSITIVE),
        ("ttc_spacing_max_s", config.ttc_spacing_max_s, POSITIVE),
        ("path_distance_mean_m", config.path_distance_mean_m, SIZE),
        ("path_distance_sd_m", config.path_distance_sd_m, SIZE),
        ("path_distance_min_m", config.path_distance_min_m, SIZE),
        ("path_phi", config.path_phi, FRACTION),
        ("path_innovation_variance_m2", config.path_innovation_variance_m2, SIZE),
        ("path_beta", config.path_beta, FRACTION),
        ("path_lead_steps", config.path_lead_steps as f64, [0.0, 1e6]),
        ("path_trail_steps", config.path_trail_steps as f64, [0.0, 1e6]),
        ("forecast_steps", config.forecast_steps as f64, HELD),
        ("smoothing_half_width", config.smoothing_half_width as f64, COUNT),
        ("estimate_every_steps", config.estimate_every_steps as f64, SOME),
        ("position_scale_m", config.position_scale_m, POSITIVE),
        ("vessel_length_m", config.vessel_length_m, POSITIVE),
        ("vessel_beam_m", config.vessel_beam_m, POSITIVE),
        ("collision_radius_m", config.collision_radius_m, POSITIVE),
        ("dcpa_scale_m", config.dcpa_scale_m, POSITIVE),
        ("tcpa_scale_s", config.tcpa_scale_s, POSITIVE),
    ]
}

fn coastal_numbers(config: &CoastalConfig) -> Vec<BoundedNumber> {
    vec![
        ("decisions", config.decisions as f64, HELD),
        ("start_position_sd_m", config.start_position_sd_m, SIZE),
        ("start_heading_port_deg", config.start_heading_port_deg, HALF_TURN_DEG),
        ("linear_obstacles", config.linear_obstacles as f64, [0.0, 1000.0]),
        ("linear_speed_sd_mps", config.linear_speed_sd_mps, SIZE),
        ("following_course_deg", config.following_course_deg, HALF_TURN_DEG),
        ("following_back_min_m", config.following_back_min_m, SIZE),
        ("following_back_max_m", config.following_back_max_m, SIZE),
        ("other_offset_min_m", config.other_offset_min_m, SIZE),
        ("other_offset_max_m", config.other_offset_max_m, SIZE),
        ("other_dcpa_min_m", config.other_dcpa_min_m, SIZE),
        ("collision_distance_m", config.collision_distance_m, POSITIVE),
        ("cross_track_limit_m", config.cross_track_limit_m, SIZE),
        ("history_positions", config.history_positions as f64, [2.0, 1e5]),
        ("forecast_steps", config.forecast_steps as f64, HELD),
        ("forecast_every_decisions", config.forecast_every_decisions as f64, SOME),
        ("noise_m", config.noise_m, SIZE),
        ("vessel_length_m", config.vessel_length_m, POSITIVE),
        ("vessel_beam_m", config.vessel_beam_m, POSITIVE),
        ("speed_scale_mps", config.speed_scale_mps, POSITIVE),
        ("cross_track_scale_m", config.cross_track_scale_m, POSITIVE),
        ("distance_scale_m", config.distance_scale_m, POSITIVE),
        ("dcpa_scale_m", config.dcpa_scale_m, POSITIVE),
        ("tcpa_scale_s", config.tcpa_scale_s, POSITIVE),
    ]
}

fn head_on_numbers(config: &HeadOnConfig) -> Vec<BoundedNumber> {
    vec![
        ("own_speed_mps", config.own_speed_mps, POSITIVE),
        ("time_to_collision_s", config.time_to_collision_s, POSITIVE),
        ("turn_per_decision_deg", config.turn_per_decision_deg, HALF_TURN_DEG),
        ("decision_interval_s", config.decision_interval_s, POSITIVE),
        ("history_s", config.history_s, SIZE),
        ("future_s", config.future_s, SIZE),
        ("spacing_s", config.spacing_s, POSITIVE),
        ("speed_min_mps", config.speed_min_mps, SIZE),
        ("speed_max_mps", config.speed_max_mps, POSITIVE),
        ("curve_deg", config.curve_deg, HALF_TURN_DEG),
        ("curve_within_s", config.curve_within_s, SIZE),
        ("curve_contact_m", config.curve_contact_m, SIZE),
        ("straight_deg", config.straight_deg, HALF_TURN_DEG),
        ("straight_contact_m", config.straight_contact_m, SIZE),
        ("straight_starboard_offset_m", config.straight_starboard_offset_m, [-1e6, 1e6]),
        ("clear_m", config.clear_m, SIZE),
    ]
}

fn trainer_numbers(config: &TrainerConfig) -> Vec<BoundedNumber> {
    vec![
        ("replay_capacity", config.replay_capacity as f64, [2.0, 1e12]),
        ("random_steps", config.random_steps as f64, COUNT),
        ("evaluate_every", config.evaluate_every as f64, SOME),
        ("evaluation_episodes", config.evaluation_episodes as f64, SOME),
    ]
}

fn agent_numbers(config: &AgentConfig) -> Vec<BoundedNumber> {
    vec![
        ("history_len", config.history_len as f64, [0.0, 1e5]),
        ("hidden", config.hidden as f64, [1.0, 1e4]),
        ("batch_size", config.batch_size as f64, HELD),
    ]
}

fn td3_numbers(config: &Td3Config) -> Vec<BoundedNumber> {
    vec![
        ("discount", config.discount, FRACTION),
        ("actor_learning_rate", config.actor_learning_rate, FRACTION),
        ("critic_learning_rate", config.critic_learning_rate, FRACTION),
        ("target_rate", config.target_rate, FRACTION),
        ("target_noise_sd", config.target_noise_sd, SIZE),
        ("target_noise_clip", config.target_noise_clip, SIZE),
        ("policy_delay", config.policy_delay as f64, SOME),
        ("exploration_noise_sd", config.exploration_noise_sd, SIZE),
        ("critic_only_updates", config.critic_only_updates as f64, COUNT),
        ("action_penalty", config.action_penalty, SIZE),
    ]
}

fn sac_numbers(config: &SacConfig) -> Vec<BoundedNumber> {
    vec![
        ("discount", config.discount, FRACTION),
        ("actor_learning_rate", config.actor_learning_rate, FRACTION),
        ("critic_learning_rate", config.critic_learning_rate, FRACTION),
        ("temperature_learning_rate", config.temperature_learning_rate, FRACTION),
        ("initial_temperature", config.initial_temperature, [1e-12, 1e6]),
        ("target_entropy", config.target_entropy, [-1e6, 1e6]),
        ("target_rate", config.target_rate, FRACTION),
        ("log_sd_min", config.log_sd_min, [-100.0, 100.0]),
        ("log_sd_max", config.log_sd_max, [-100.0, 100.0]),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::config::join;
    use crate::env::EnvName;

    #[test]
    fn defaults_are_within_their_bounds() {
        for env in [EnvName::OpenWater, EnvName::Coastal] {
            assert_eq!(RunConfig::of(env).check(), Ok(()));
        }
    }

    /// A new key without bounds is noticed here. Any seed will do, and the tanker checks itself.
    #[test]
    fn every_number_has_bounds() {
        let config = RunConfig::default();
        let mut numbers = BTreeSet::new();
        collect("", &serde_json::to_value(&config).unwrap(), &mut numbers);
        numbers.retain(|path| path != "trainer.seed" && !path.starts_with("coastal.head_on.kvlcc2."));
        let bounded = config.numbers().into_iter().flat_map(|(table, numbers)| {
            numbers.into_iter().map(move |(key, ..)| join(table, key)).collect::<Vec<_>>()
        });
        assert_eq!(bounded.collect::<BTreeSet<_>>(), numbers);
    }

    fn collect(path: &str, value: &serde_json::Value, numbers: &mut BTreeSet<String>) {
        match value {
            serde_json::Value::Number(_) => {
                numbers.insert(path.to_owned());
            }
            serde_json::Value::Object(table) => {
                table.iter().for_each(|(key, value)| collect(&join(path, key), value, numbers));
            }
            _ => {}
        }
    }

    #[test]
    fn the_first_number_out_of_bounds_is_named() {
        let mut config = RunConfig::default();
        config.trainer.agent.sac.discount = f64::NAN;
        let fault = config.check().unwrap_err();
        assert_eq!(
            fault.to_string(),
            "trainer.agent.sac.discount: NaN is not possible here; write a number from 0 to 1"
        );

        let mut config = RunConfig::default();
        config.open_water.agent_speed_min_mps = 6.0;
        let fault = config.check().unwrap_err();
        assert_eq!(fault.key, "open_water.agent_speed_min_mps");
        assert_eq!(fault.message, "6 is above agent_speed_max_mps, which is 5");
    }
}
