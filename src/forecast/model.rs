//! A trained forecaster: which network, on what it was trained, and its weights, in one file.

use std::path::Path;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::dataset::{Process, RecordedConfig, SyntheticConfig};
use super::encoding::Encoding;
use super::network::{ForecastNetwork, NetworkConfig};
use super::{SplitConfig, Trainer, TrainingConfig};
use crate::geo::Geodetic;
use crate::nn::Adam;
use crate::nn::weights::{WeightsError, WeightsFile, WeightsWriter};

/// The paper's two networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModelKind {
    /// Reads 10 positions, gives the next one.
    OpenWater,
    /// Reads 75 positions and where they are ("anchoring"), gives the next 10.
    Coastal,
}

impl ModelKind {
    /// The sizes of its network.
    #[must_use]
    pub fn network(self) -> NetworkConfig {
        match self {
            Self::OpenWater => NetworkConfig::open_water(),
            Self::Coastal => NetworkConfig::coastal(),
        }
    }

    /// Positions read.
    #[must_use]
    pub fn history_len(self) -> usize {
        self.network().steps + 1
    }

    /// Positions given by one call.
    #[must_use]
    pub fn outputs(self) -> usize {
        self.network().predicted
    }

    /// Steps that it is rolled out to in the paper.
    #[must_use]
    pub fn horizon(self) -> usize {
        match self {
            Self::OpenWater => 100,
            Self::Coastal => 200,
        }
    }
}

/// Where segments come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum DataConfig {
    /// Drawn from a known process.
    Synthetic {
        /// The motion.
        process: Process,
        /// How segments are drawn.
        #[serde(default)]
        segments: SyntheticConfig,
    },
    /// Cut out of recorded tracks.
    Recorded {
        /// The area file.
        area: String,
        /// The AIS files.
        files: Vec<String>,
        /// Time between two positions, in seconds.
        #[serde(default = "default_dt_s")]
        dt_s: f64,
        /// What trains and what is held out.
        #[serde(default)]
        split: SplitConfig,
        /// How segments are drawn.
        #[serde(default)]
        segments: RecordedConfig,
    },
}

fn default_dt_s() -> f64 {
    SyntheticConfig::default().dt_s
}

/// What a forecaster is and what it was trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// What tables and figures call it.
    pub name: String,
    /// Which network.
    pub kind: ModelKind,
    /// What it learns from.
    pub data: DataConfig,
    /// How.
    #[serde(default)]
    pub training: TrainingConfig,
}

impl ModelConfig {
    /// Time between two positions, in seconds.
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        match &self.data {
            DataConfig::Synthetic { segments, .. } => segments.dt_s,
            DataConfig::Recorded { dt_s, .. } => *dt_s,
        }
    }

    pub(super) fn encoding(&self) -> Encoding {
        Encoding {
            history_len: self.kind.history_len(),
            outputs: self.kind.outputs(),
            scaling: self.training.scaling,
        }
    }
}

/// A network with its weights, ready to forecast with.
#[derive(Debug, Clone)]
pub struct Model {
    /// What it is.
    pub config: ModelConfig,
    /// Origin of the plane of recorded tracks, which absolute positions refer to.
    pub origin: Option<Geodetic>,
    /// Updates that made the weights.
    pub steps: u64,
    pub(super) network: ForecastNetwork<f32>,
}

/// Why a file does not hold a forecaster.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The file, its tensors or its facts.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The description inside.
    #[error(
        "{path}: the fact `{key}` is no valid {what} ({reason}); train the model again or take another file"
    )]
    Fact {
        /// The file.
        path: String,
        /// The fact.
        key: &'static str,
        /// What it should be.
        what: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// A checkpoint of another run.
    #[error(
        "{path}: this checkpoint belongs to a run with other settings; resume with the settings it was begun with \
         (see the `config.toml` beside it) or start in another folder"
    )]
    OtherRun {
        /// The file.
        path: String,
    },
    /// A model that cannot be trained on.
    #[error("{path}: cannot be trained on here: its kind or its `scaling` is another; configure the same")]
    OtherStart {
        /// The file.
        path: String,
    },
    /// Sizes that are not those of the kind.
    #[error(
        "{path}: the network inside has other sizes than that of a {kind:?} forecaster; take another file"
    )]
    OtherNetwork {
        /// The file.
        path: String,
        /// What the file says it is.
        kind: ModelKind,
    },
}

impl Model {
    /// What the trainer has learnt so far.
    #[must_use]
    pub fn of(trainer: &Trainer, config: &ModelConfig, origin: Option<Geodetic>) -> Self {
        let mut network = trainer.network.clone();
        network.parameters = trainer.average.frozen();
        Self { config: config.clone(), origin, steps: trainer.step(), network }
    }

    /// The file's content.
    #[must_use]
    pub fn to_file(&self) -> WeightsWriter {
        with_facts(self.network.writer(), &self.config, self.origin, self.steps)
    }

    /// The model in a file.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, and as [`Self::from_file`].
    pub fn open(path: &Path) -> Result<Self, ModelError> {
        Self::from_file(WeightsFile::open(path)?)
    }

    /// Reads what [`Self::to_file`] wrote.
    ///
    /// # Errors
    ///
    /// When the file lacks a tensor or a fact, or one of them is not what it should be.
    pub fn from_file(file: WeightsFile) -> Result<Self, ModelError> {
        let path = file.path().display().to_string();
        let config: ModelConfig = fact(&file, "config", "description of a forecaster")?;
        let origin: Option<Geodetic> = fact(&file, "origin", "point in degrees")?;
        let steps = file.fact("steps")?;
        let mut network = ForecastNetwork::<f32>::read(&file)?;
        file.finish()?;
        if *network.config() != config.kind.network() {
            return Err(ModelError::OtherNetwork { path, kind: config.kind });
        }
        network.parameters = network.parameters.frozen();
        Ok(Self { config, origin, steps, network })
    }
}

impl Trainer {
    /// Begins with the weights of a model instead of random ones; the optimiser begins anew.
    ///
    /// # Errors
    ///
    /// When the model is of another kind or has other scales.
    pub fn start_from(&mut self, path: &str, model: &Model) -> Result<(), ModelError> {
        let fits = model.network.config() == self.network.config()
            && model.config.training.scaling == self.config.scaling;
        if !fits {
            return Err(ModelError::OtherStart { path: path.to_owned() });
        }
        self.network.parameters.copy_from(&model.network.parameters);
        self.average.copy_from(&model.network.parameters);
        Ok(())
    }

    /// Everything needed to go on exactly from here.
    #[must_use]
    pub fn checkpoint(&self, config: &ModelConfig, origin: Option<Geodetic>) -> WeightsWriter {
        let layout = self.network.parameters.layout();
        let (first, second) = self.adam.moments();
        with_facts(WeightsWriter::new(), config, origin, self.step)
            .fact("rng", json(&self.rng))
            .tensors("weights.", layout, self.network.parameters.values())
            .tensors("average.", layout, self.average.values())
            .tensors("first_moment.", layout, first)
            .tensors("second_moment.", layout, second)
    }

    /// Puts this run where the one stood that wrote the checkpoint.
    ///
    /// # Errors
    ///
    /// When the file is not a checkpoint, or is one of a run with other settings.
    pub fn resume(&mut self, config: &ModelConfig, file: WeightsFile) -> Result<(), ModelError> {
        let path = file.path().display().to_string();
        if fact::<ModelConfig>(&file, "config", "description of a forecaster")? != *config {
            return Err(ModelError::OtherRun { path });
        }
        let step: u64 = file.fact("steps")?;
        let rng = fact(&file, "rng", "state of a random stream")?;
        let layout = self.network.parameters.layout().clone();
        file.read_parameters("weights.", &mut self.network.parameters)?;
        file.read_parameters("average.", &mut self.average)?;
        let mut adam = Adam::new(&layout, self.config.adam.clone());
        let mut outcome = Ok(());
        adam.restore(step, |first, second| {
            outcome = file
                .read("first_moment.", &layout, first)
                .and_then(|()| file.read("second_moment.", &layout, second));
        });
        outcome?;
        file.finish()?;
        (self.adam, self.rng, self.step) = (adam, rng, step);
        Ok(())
    }
}

fn with_facts(
    writer: WeightsWriter,
    config: &ModelConfig,
    origin: Option<Geodetic>,
    steps: u64,
) -> WeightsWriter {
    writer.fact("config", json(config)).fact("origin", json(&origin)).fact("steps", steps)
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("plain structs of numbers and names")
}

fn fact<T: serde::de::DeserializeOwned>(
    file: &WeightsFile,
    key: &'static str,
    what: &'static str,
) -> Result<T, ModelError> {
    let text: String = file.fact(key)?;
    serde_json::from_str(&text).map_err(|error| ModelError::Fact {
        path: file.path().display().to_string(),
        key,
        what,
        reason: error.to_string(),
    })
}
