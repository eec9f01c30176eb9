//! The environments by name, each with what it shows, takes and rewards, as its configuration has it.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::coastal::CoastalConfig;
use super::open_water::OpenWaterConfig;

/// The environments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EnvName {
    /// Open water with passing rules (the paper's training environment).
    #[default]
    OpenWater,
    /// Head-on encounters with recorded vessels in coastal waters.
    Coastal,
}

impl EnvName {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::OpenWater, Self::Coastal];

    /// What files and command lines call it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::OpenWater => "open-water",
            Self::Coastal => "coastal",
        }
    }

    /// What it is, in a sentence.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::OpenWater => {
                "A field of obstacles in open water, each to be left on the side that its rule asks for"
            }
            Self::Coastal => {
                "Head-on with a recorded vessel in coastal waters, which may be about to turn away, among other traffic"
            }
        }
    }
}

impl FromStr for EnvName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|name| name.as_str() == text);
        known.ok_or_else(|| format!("choose {}", Self::ALL.map(Self::as_str).join(" or ")))
    }
}

/// One component of an observation or action, or one term of a reward.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Value {
    /// Index of the component; of components that repeat, with `j`. Name of a reward term.
    pub index: String,
    /// What it is.
    pub meaning: String,
    /// What it is divided by, with the unit; for actions the greatest value.
    pub scale: String,
    /// Where it lies.
    pub range: &'static str,
}

/// What an environment shows, takes and rewards.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Description {
    /// The environment.
    pub name: EnvName,
    /// What it is, in a sentence.
    pub summary: &'static str,
    /// Length of an observation.
    pub observation_len: usize,
    /// Components of an observation.
    pub observation: Vec<Value>,
    /// How components that repeat are counted and ordered.
    pub order: String,
    /// Components of an action.
    pub action: Vec<Value>,
    /// Terms of the reward of one decision.
    pub reward: Vec<Value>,
    /// How an episode ends.
    pub episode: String,
}

const WRAPPED: &str = "(-1, 1]";
const POSITIVE: &str = "0 and more";
const ANY: &str = "any";

fn value(index: impl ToString, meaning: impl ToString, scale: impl ToString, range: &'static str) -> Value {
    Value { index: index.to_string(), meaning: meaning.to_string(), scale: scale.to_string(), range }
}

impl OpenWaterConfig {
    /// What the environment shows, takes and rewards with these settings.
    #[must_use]
    pub fn describe(&self, estimates: bool) -> Description {
        let speed = format!("{} m/s", self.agent_speed_max_mps);
        let position = format!("{} m", self.position_scale_m);
        let acceleration = format!("{} m/s²", self.agent_acceleration_max_mps2);
        let mut observation = vec![
            value(0, "lateral acceleration last applied", &acceleration, "[-1, 1]"),
            value(1, "longitudinal speed of the agent", &speed, "(0, 1]"),
            value(2, "lateral speed of the agent, positive to port", &speed, "[-1, 1]"),
        ];
        let stride = if estimates { 4 } else { 2 };
        let at = |offset: usize| format!("{offset} + {stride} j");
        observation.push(value(at(3), "agent ahead of the obstacle", &position, ANY));
        observation.push(value(at(4), "agent to port of the obstacle", &position, ANY));
        if estimates {
            observation.push(value(at(5), "estimated DCPA", format!("{} m", self.dcpa_scale_m), POSITIVE));
            observation.push(value(at(6), "estimated TCPA", format!("{} s", self.tcpa_scale_s), ANY));
        }
        let key = if estimates { "estimated TCPA" } else { "distance" };
        Description {
            name: EnvName::OpenWater,
            summary: EnvName::OpenWater.summary(),
            observation_len: self.observation_len(estimates),
            observation,
            order: format!(
                "j counts obstacles: the {} of rule right, then the {} of rule left, each by ascending {key}",
                self.obstacles_per_rule, self.obstacles_per_rule
            ),
            action: vec![value(
                0,
                "lateral acceleration, positive to port",
                acceleration,
                "[-1, 1], clipped",
            )],
            reward: vec![value(
                "wrong_passings",
                "minus the obstacles passed on the wrong side in this step",
                "1",
                "0 and less",
            )],
            episode: format!(
                "{} decisions, one every {} s; truncated, never terminated",
                self.decisions, self.dt_s
            ),
        }
    }
}

impl CoastalConfig {
    /// What the environment shows, takes and rewards with these settings.
    #[must_use]
    pub fn describe(&self, estimates: bool) -> Description {
        let speed = format!("{} m/s", self.speed_scale_mps);
        let less = format!("less {} m", self.collision_distance_m);
        let mut observation = vec![
            value(0, "own speed", &speed, POSITIVE),
            value(1, "cross-track error, positive to port", format!("{} m", self.cross_track_scale_m), ANY),
        ];
        let stride = if estimates { 6 } else { 4 };
        let at = |offset: usize| format!("{offset} + {stride} j");
        observation.extend([
            value(at(2), format!("distance {less}"), format!("{} m", self.distance_scale_m), ANY),
            value(at(3), "relative bearing, positive to starboard", "180°", WRAPPED),
            value(at(4), "its course less own heading", "180°", WRAPPED),
            value(at(5), "its speed", &speed, POSITIVE),
        ]);
        if estimates {
            observation.extend([
                value(at(6), format!("estimated DCPA {less}"), format!("{} m", self.dcpa_scale_m), ANY),
                value(at(7), "estimated TCPA", format!("{} s", self.tcpa_scale_s), ANY),
            ]);
        }
        let key = if estimates { "estimated DCPA" } else { "distance" };
        let turn = format!("{}°", self.head_on.turn_per_decision_deg);
        Description {
            name: EnvName::Coastal,
            summary: EnvName::Coastal.summary(),
            observation_len: self.observation_len(estimates),
            observation,
            order: format!("j counts the {} obstacles by ascending {key}", self.obstacles()),
            action: vec![value(0, "change of heading, positive to starboard", turn, "[-1, 1], clipped")],
            reward: vec![
                value(
                    "wrong_side",
                    format!(
                        "-1 where the cross-track error is {} m to port or more",
                        self.cross_track_limit_m
                    ),
                    "1",
                    "-1 or 0",
                ),
                value(
                    "too_close",
                    format!("minus the obstacles within {} m", self.collision_distance_m),
                    "1",
                    "0 and less",
                ),
            ],
            episode: format!(
                "{} decisions, one every {} s; truncated, never terminated",
                self.decisions, self.head_on.decision_interval_s
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::Env;
    use crate::env::open_water::OpenWater;

    #[test]
    fn names_are_those_of_files() {
        for name in EnvName::ALL {
            assert_eq!(name.as_str().parse(), Ok(name));
            assert_eq!(serde_json::to_value(name).unwrap(), name.as_str());
        }
        assert_eq!("river".parse::<EnvName>(), Err("choose open-water or coastal".into()));
    }

    /// The components that do not repeat, and those that do once per obstacle, make up the observation.
    #[test]
    fn descriptions_cover_the_whole_observation() {
        for estimates in [true, false] {
            let described = [
                (OpenWaterConfig::default().describe(estimates), 10),
                (CoastalConfig::default().describe(estimates), 4),
            ];
            for (description, obstacles) in described {
                let repeating =
                    description.observation.iter().filter(|value| value.index.contains('j')).count();
                let once = description.observation.len() - repeating;
                assert_eq!(once + repeating * obstacles, description.observation_len);
                for (offset, value) in description.observation.iter().enumerate() {
                    assert_eq!(value.index.split(' ').next(), Some(offset.to_string().as_str()));
                }
            }
        }
    }

    #[test]
    fn reward_terms_are_those_of_the_environment() {
        let config = OpenWaterConfig::default();
        let names: Vec<String> = config.describe(false).reward.into_iter().map(|term| term.index).collect();
        let env = OpenWater::new(config, None).unwrap();
        assert_eq!(names, env.reward_terms().iter().map(|term| term.name).collect::<Vec<_>>());
    }
}
