//! Everything that a training run depends on.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, Source};
use crate::env::EnvName;
use crate::env::coastal::CoastalConfig;
use crate::env::open_water::{MotionKind, OpenWaterConfig};
use crate::env::registry::Description;
use crate::forecast::SplitConfig;
use crate::rl::trainer::TrainerConfig;

/// The recorded tracks that coastal encounters are made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TracksConfig {
    /// The area file.
    pub area: PathBuf,
    /// The AIS files.
    pub files: Vec<PathBuf>,
    /// What trains and what is held out: the same split as the forecaster's.
    pub split: SplitConfig,
}

impl Default for TracksConfig {
    fn default() -> Self {
        Self {
            area: "ais/ny-lower-bay.toml".into(),
            files: vec!["ais/ny-harbor-2020-12.csv.gz".into()],
            split: SplitConfig::default(),
        }
    }
}

/// Everything that a run depends on. Every key has a default: the paper's value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunConfig {
    /// The environment.
    pub env: EnvName,
    /// Decisions to train on.
    pub steps: u64,
    /// Whether the observation holds estimates of the collision risk.
    pub estimates: bool,
    /// Weights of the forecaster behind the estimates; without it, the shipped one for the environment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forecaster: Option<PathBuf>,
    /// Constants of the open-water environment.
    pub open_water: OpenWaterConfig,
    /// Constants of the coastal environment.
    pub coastal: CoastalConfig,
    /// The recorded tracks of the coastal environment.
    pub tracks: TracksConfig,
    /// Training and agent.
    pub trainer: TrainerConfig,
}

impl Default for RunConfig {
    fn default() -> Self {
        Self::of(EnvName::default())
    }
}

impl RunConfig {
    /// The paper's values for an environment.
    #[must_use]
    pub fn of(env: EnvName) -> Self {
        let (steps, evaluate_every) = match env {
            EnvName::OpenWater => (1_500_000, 10_000),
            EnvName::Coastal => (1_000_000, 5_000),
        };
        Self {
            env,
            steps,
            estimates: true,
            forecaster: None,
            open_water: OpenWaterConfig::default(),
            coastal: CoastalConfig::default(),
            tracks: TracksConfig::default(),
            trainer: TrainerConfig { evaluate_every, ..TrainerConfig::default() },
        }
    }

    /// Reads a file of settings; what it leaves out is the paper's value for its environment, or for `env`
    /// where that is given.
    ///
    /// # Errors
    ///
    /// As [`Source::read`] and [`Source::parse`], and on a number out of its bounds.
    pub fn load(file: &Path, env: Option<EnvName>) -> Result<Self, ConfigError> {
        let source = Source::read(file)?;
        let mut resolved: Self = source.parse()?;
        resolved.env = env.unwrap_or(resolved.env);
        resolved.fill_in(&source.parse()?);
        resolved.check().map_err(|fault| source.located(fault))?;
        Ok(resolved)
    }

    /// The same from settings in memory, whose numbers are yet to be checked.
    ///
    /// # Errors
    ///
    /// On a key that there is not, or a value of the wrong type.
    pub fn from_table(given: &toml::Table) -> Result<Self, toml::de::Error> {
        let mut resolved: Self = given.clone().try_into()?;
        resolved.fill_in(given);
        Ok(resolved)
    }

    /// Puts the values of the paper that depend on the environment where the settings give none.
    fn fill_in(&mut self, given: &toml::Table) {
        let defaults = Self::of(self.env);
        if !given.contains_key("steps") {
            self.steps = defaults.steps;
        }
        let trainer = given.get("trainer").and_then(toml::Value::as_table);
        if !trainer.is_some_and(|trainer| trainer.contains_key("evaluate_every")) {
            self.trainer.evaluate_every = defaults.trainer.evaluate_every;
        }
    }

    /// What the environment depends on, as a text to compare by.
    #[must_use]
    pub fn environment_key(&self) -> String {
        let config = Self { steps: 0, trainer: TrainerConfig::default(), ..self.clone() };
        serde_json::to_string(&config).expect("plain data with string keys")
    }

    /// The forecaster behind the estimates: that which is named, or the shipped one.
    #[must_use]
    pub fn forecaster_file(&self) -> PathBuf {
        self.forecaster.clone().unwrap_or_else(|| {
            let name = match (self.env, self.open_water.motion) {
                (EnvName::OpenWater, MotionKind::Stochastic) => "open-water-stochastic",
                (EnvName::OpenWater, MotionKind::Periodic) => "open-water-periodic",
                (EnvName::Coastal, _) => "coastal-ny-lower-bay",
            };
            PathBuf::from(format!("models/{name}.safetensors"))
        })
    }

    /// What the environment shows, takes and rewards, with or without estimates.
    #[must_use]
    pub fn describe(&self, estimates: bool) -> Description {
        match self.env {
            EnvName::OpenWater => self.open_water.describe(estimates),
            EnvName::Coastal => self.coastal.describe(estimates),
        }
    }

    /// Length of an observation.
    #[must_use]
    pub fn observation_len(&self) -> usize {
        match self.env {
            EnvName::OpenWater => self.open_water.observation_len(self.estimates),
            EnvName::Coastal => self.coastal.observation_len(self.estimates),
        }
    }
}
