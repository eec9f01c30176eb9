//! The folder of a training run: its configuration, environments, weights and logs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

use super::recorded;
use crate::config::{ConfigError, Source};
use crate::env::Env;
use crate::env::coastal::{Coastal, CoastalConfig, RecordedTraffic};
use crate::env::open_water::{MotionKind, OpenWater, OpenWaterConfig};
use crate::forecast::{Forecaster, LstmForecaster, Model, SplitConfig, split_by_time};
use crate::geo::Geodetic;
use crate::nn::weights::WeightsFile;
use crate::rl::agent::Agent;
use crate::rl::trainer::TrainerConfig;

/// Name of the resolved configuration in a run's folder.
pub const CONFIG: &str = "config.toml";
/// Name of the weights of the best policy in a run's folder.
pub const POLICY: &str = "policy.safetensors";

/// The environments that agents can be trained in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum EnvName {
    /// Open water with passing rules (the paper's training environment).
    #[default]
    OpenWater,
    /// Head-on encounters with recorded vessels in coastal waters.
    Coastal,
}

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

/// Which part of the recorded time encounters are drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TracksPart {
    /// The part that agents learn from.
    Training,
    /// The part that they never see.
    HeldOut,
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
    pub fn load(file: &Path, env: Option<EnvName>) -> Result<Self, ConfigError> {
        let source = Source::read(file)?;
        let given: toml::Table = source.parse()?;
        let mut resolved: Self = source.parse()?;
        resolved.env = env.unwrap_or(resolved.env);
        let defaults = Self::of(resolved.env);
        if !given.contains_key("steps") {
            resolved.steps = defaults.steps;
        }
        let trainer = given.get("trainer").and_then(toml::Value::as_table);
        if !trainer.is_some_and(|trainer| trainer.contains_key("evaluate_every")) {
            resolved.trainer.evaluate_every = defaults.trainer.evaluate_every;
        }
        Ok(resolved)
    }

    /// Reads the configuration of the run in `folder`.
    pub fn of_run(folder: &Path) -> anyhow::Result<Self> {
        let file = folder.join(CONFIG);
        if !file.exists() {
            bail!(
                "{} is no run: it has no {CONFIG}; give the folder that `searoom train` wrote",
                folder.display()
            );
        }
        Ok(Self::load(&file, None)?)
    }

    /// The forecaster's weights.
    fn forecaster_file(&self) -> PathBuf {
        self.forecaster.clone().unwrap_or_else(|| {
            let name = match (self.env, self.open_water.motion) {
                (EnvName::OpenWater, MotionKind::Stochastic) => "open-water-stochastic",
                (EnvName::OpenWater, MotionKind::Periodic) => "open-water-periodic",
                (EnvName::Coastal, _) => "coastal-ny-lower-bay",
            };
            PathBuf::from(format!("models/{name}.safetensors"))
        })
    }

    fn load_forecaster(&self) -> anyhow::Result<Model> {
        let file = self.forecaster_file();
        let model = WeightsFile::open(&file)
            .map_err(anyhow::Error::from)
            .and_then(|file| Ok(Model::from_file(file)?));
        model.with_context(|| {
            format!(
                "{}: no forecaster for the estimates; name one with `forecaster`, or train without estimates \
                 (--no-estimates)",
                file.display()
            )
        })
    }
}

/// Makes environments of a run; what they can share is loaded once.
pub struct EnvMaker {
    config: RunConfig,
    model: Option<Model>,
    traffic: Option<Arc<RecordedTraffic>>,
}

impl EnvMaker {
    /// Loads forecaster and tracks.
    pub fn new(config: &RunConfig, part: TracksPart) -> anyhow::Result<Self> {
        let model = config.estimates.then(|| config.load_forecaster()).transpose()?;
        let traffic = match config.env {
            EnvName::OpenWater => None,
            EnvName::Coastal => Some(load_traffic(config, part, model.as_ref())?),
        };
        Ok(Self { config: config.clone(), model, traffic })
    }

    /// An environment, with its forecaster on one thread.
    pub fn make(&self) -> anyhow::Result<Box<dyn Env>> {
        let forecaster = self
            .model
            .clone()
            .map(|model| -> Box<dyn Forecaster> { Box::new(LstmForecaster::new(model, 1)) });
        match &self.traffic {
            None => {
                let config = self.config.open_water.clone();
                Ok(Box::new(OpenWater::new(config, forecaster).context("key \"open_water\"")?))
            }
            Some(traffic) => {
                let config = self.config.coastal.clone();
                let env = Coastal::new(config, Arc::clone(traffic), forecaster);
                Ok(Box::new(env.context("key \"coastal\"")?))
            }
        }
    }
}

fn load_traffic(
    config: &RunConfig,
    part: TracksPart,
    model: Option<&Model>,
) -> anyhow::Result<Arc<RecordedTraffic>> {
    let TracksConfig { area, files, split } = &config.tracks;
    let recorded = recorded::import(area, files.iter().map(PathBuf::as_path)).context("key \"tracks\"")?;
    if let Some(model) = model {
        check_origin(model, recorded.origin, area)?;
    }
    let split = split_by_time(&recorded.tracks, split).context("key \"tracks.split\"")?;
    let tracks = match part {
        TracksPart::Training => split.train,
        TracksPart::HeldOut => split.test,
    };
    Ok(Arc::new(RecordedTraffic::new(tracks, &config.coastal).context("key \"tracks\"")?))
}

/// A forecaster knows where it is: in another plane its anchors mean other places.
fn check_origin(model: &Model, origin: Geodetic, area: &Path) -> anyhow::Result<()> {
    match model.origin {
        Some(trained) if trained != origin => bail!(
            "the forecaster \"{}\" was trained in a plane about {:.4}, {:.4}, but {} has its own about {:.4}, {:.4}; \
             name a forecaster of this area with `forecaster`, or train without estimates (--no-estimates)",
            model.config.name,
            trained.latitude_deg,
            trained.longitude_deg,
            area.display(),
            origin.latitude_deg,
            origin.longitude_deg,
        ),
        _ => Ok(()),
    }
}

/// Fills the actor of `agent` from the weights of a policy.
pub fn load_policy(file: &Path, agent: &mut Agent) -> anyhow::Result<()> {
    let weights = WeightsFile::open(file)?;
    let [actor, ..] = agent.networks();
    weights.read_parameters("", actor.online)?;
    Ok(weights.finish()?)
}
