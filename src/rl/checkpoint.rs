//! Checkpoints on disk: everything a training run needs to go on with the bits it would have had.
//!
//! A checkpoint is `checkpoint.safetensors` (weights, targets, moments; the rest as JSON in its
//! metadata) and the chunks of the replay that it names, in `replay/`. Chunks are written first, under
//! names that no earlier checkpoint uses, then the file that names them is put in place at once, then
//! chunks that it does not name are removed. Whenever the process dies, the folder holds one whole
//! checkpoint: the old or the new one. Chunks that have not changed since are not written again.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::{Deserialize, Serialize};

use super::agent::{Agent, NetworkState};
use super::replay::{Chunk, Replay, ReplayShape};
use super::trainer::{Trainer, TrainerConfig, TrainerState};
use crate::atomic_file::{self, WriteError};
use crate::config::first_difference;
use crate::nn::weights::{WeightsError, WeightsFile, WeightsWriter};

/// Name of the file in a run's folder.
pub const FILE: &str = "checkpoint.safetensors";
/// Name of the folder of replay chunks in a run's folder.
pub const REPLAY_FOLDER: &str = "replay";

/// Why a checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Weights could not be written or read.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A folder or chunk could not be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The checkpoint was made with another configuration.
    #[error(
        "{}: made with another configuration, `{key}` was {theirs} and is {ours}; resume with the \
         configuration of the run, or start a new one", path.display()
    )]
    OtherConfig {
        /// The checkpoint.
        path: PathBuf,
        /// The first key that differs.
        key: String,
        /// Its value in the checkpoint.
        theirs: String,
        /// Its value now.
        ours: String,
    },
    /// A chunk of the replay is missing parts or does not belong.
    #[error("{}: the replay is damaged ({reason}); start the run anew", path.display())]
    Replay {
        /// The chunk or the folder.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The environment refuses the actions of the episode under way.
    #[error("{}: the environment refuses the recorded actions: it is not the one they were taken in", path.display())]
    OtherEnvironment {
        /// The checkpoint.
        path: PathBuf,
    },
}

/// What the metadata hold.
#[derive(Debug, Serialize, Deserialize)]
struct Record {
    config: TrainerConfig,
    state: TrainerState,
    /// Steps taken by the optimisers of actor and critics.
    adam_steps: [u64; 3],
    /// Files of the replay's chunks, in order.
    chunks: Vec<String>,
}

/// Writes checkpoints of one run into its folder, knowing which chunks are there already.
#[derive(Debug)]
pub struct CheckpointWriter {
    folder: PathBuf,
    chunks: Vec<String>,
}

impl CheckpointWriter {
    /// For a run that has no checkpoint yet.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), chunks: Vec::new() }
    }

    /// Writes a checkpoint of `trainer`.
    ///
    /// # Errors
    ///
    /// When a file cannot be written; the last checkpoint stays whole.
    pub fn save(&mut self, trainer: &mut Trainer) -> Result<(), CheckpointError> {
        let step = trainer.step();
        let replay_folder = self.folder.join(REPLAY_FOLDER);
        let changed = trainer.replay().take_changes();
        let count = trainer.replay().chunks().len();
        self.chunks.resize(count, String::new());
        for index in changed {
            let name = format!("chunk-{index:05}-step-{step:010}.safetensors");
            let replay = trainer.replay();
            let bytes = chunk_bytes(&replay.chunks()[index], replay.shape());
            atomic_file::write(&replay_folder.join(&name), |out| out.write_all(&bytes))?;
            self.chunks[index] = name;
        }
        let record = Record {
            config: trainer.config().clone(),
            state: trainer.state(),
            adam_steps: trainer.agent().networks().map(|network| network.adam.steps()),
            chunks: self.chunks.clone(),
        };
        let json = serde_json::to_string(&record).expect("plain data with string keys");
        let mut writer = WeightsWriter::new().fact("searoom", env!("CARGO_PKG_VERSION")).fact("record", json);
        for network in trainer.agent().networks() {
            writer = add_network(writer, &network);
        }
        writer.save(&self.folder.join(FILE))?;
        self.remove_unnamed(&replay_folder)
    }

    fn remove_unnamed(&self, folder: &Path) -> Result<(), CheckpointError> {
        let io = |source| CheckpointError::Io { path: folder.to_owned(), source };
        for entry in fs::read_dir(folder).map_err(io)? {
            let entry = entry.map_err(io)?;
            let name = entry.file_name();
            if !self.chunks.iter().any(|chunk| name == chunk.as_str()) {
                fs::remove_file(entry.path()).map_err(io)?;
            }
        }
        Ok(())
    }
}

/// The configuration that a checkpoint was made with.
///
/// # Errors
///
/// When there is no whole checkpoint in the folder.
pub fn config(folder: &Path) -> Result<TrainerConfig, CheckpointError> {
    Ok(read_record(&WeightsFile::open(&folder.join(FILE))?)?.config)
}

/// Decisions made before a checkpoint.
///
/// # Errors
///
/// When there is no whole checkpoint in the folder.
pub fn step(folder: &Path) -> Result<u64, CheckpointError> {
    Ok(read_record(&WeightsFile::open(&folder.join(FILE))?)?.state.step)
}

/// Puts `trainer`, made anew with the configuration of the run, to where the checkpoint was taken.
///
/// # Errors
///
/// When the checkpoint is damaged or was made with another configuration or environment.
pub fn load(folder: &Path, trainer: &mut Trainer) -> Result<CheckpointWriter, CheckpointError> {
    let path = folder.join(FILE);
    let file = WeightsFile::open(&path)?;
    let record = read_record(&file)?;
    same_config(&path, &record.config, trainer.config())?;
    for (network, steps) in trainer.agent().networks().into_iter().zip(record.adam_steps) {
        fill_network(&file, network, steps)?;
    }
    file.finish()?;
    let replay = read_replay(folder, &record, *trainer.replay().shape())?;
    if !trainer.restore(record.state, replay) {
        return Err(CheckpointError::OtherEnvironment { path });
    }
    Ok(CheckpointWriter { folder: folder.to_owned(), chunks: record.chunks })
}

fn read_record(file: &WeightsFile) -> Result<Record, WeightsError> {
    let json: String = file.fact("record")?;
    serde_json::from_str(&json).map_err(|error| WeightsError::Metadata {
        path: file.path().to_owned(),
        key: "record".into(),
        reason: format!("is no record of a training run ({error})"),
    })
}

fn add_network(writer: WeightsWriter, network: &NetworkState<'_>) -> WeightsWriter {
    let layout = network.online.layout();
    let (first, second) = network.adam.moments();
    let name = network.name;
    writer
        .tensors(&format!("{name}."), layout, network.online.values())
        .tensors(&format!("{name}.target."), layout, network.target.values())
        .tensors(&format!("{name}.adam.first."), layout, first)
        .tensors(&format!("{name}.adam.second."), layout, second)
}

fn fill_network(file: &WeightsFile, network: NetworkState<'_>, steps: u64) -> Result<(), WeightsError> {
    let name = network.name;
    file.read_parameters(&format!("{name}."), network.online)?;
    file.read_parameters(&format!("{name}.target."), network.target)?;
    let layout = network.online.layout();
    let mut outcome = Ok(());
    network.adam.restore(steps, |first, second| {
        outcome = file
            .read(&format!("{name}.adam.first."), layout, first)
            .and_then(|()| file.read(&format!("{name}.adam.second."), layout, second));
    });
    outcome
}

/// The weights of the policy alone, to act with.
#[must_use]
pub fn policy_weights(agent: &mut Agent) -> WeightsWriter {
    let [actor, ..] = agent.networks();
    WeightsWriter::new().tensors("", actor.online.layout(), actor.online.values())
}

fn same_config(path: &Path, theirs: &TrainerConfig, ours: &TrainerConfig) -> Result<(), CheckpointError> {
    match first_difference(theirs, ours) {
        None => Ok(()),
        Some((key, theirs, ours)) => {
            Err(CheckpointError::OtherConfig { path: path.to_owned(), key, theirs, ours })
        }
    }
}

fn chunk_bytes(chunk: &Chunk, shape: &ReplayShape) -> Vec<u8> {
    let frames = chunk.len();
    let floats =
        |values: &[f32]| -> Vec<u8> { values.iter().flat_map(|value| value.to_le_bytes()).collect() };
    let ages: Vec<u8> = chunk.ages.iter().flat_map(|age| age.to_le_bytes()).collect();
    let parts = [
        ("observations", Dtype::F32, vec![frames, shape.observation_len], floats(&chunk.observations)),
        ("actions", Dtype::F32, vec![frames, shape.action_len], floats(&chunk.actions)),
        ("rewards", Dtype::F32, vec![frames], floats(&chunk.rewards)),
        ("ages", Dtype::U32, vec![frames], ages),
        ("marks", Dtype::U8, vec![frames], chunk.marks.clone()),
    ];
    let views: HashMap<&str, TensorView<'_>> = parts
        .iter()
        .map(|(name, dtype, sizes, bytes)| {
            (*name, TensorView::new(*dtype, sizes.clone(), bytes).expect("bytes were made from the sizes"))
        })
        .collect();
    serialize(views, None).expect("views were checked one by one")
}

fn read_replay(folder: &Path, record: &Record, shape: ReplayShape) -> Result<Replay, CheckpointError> {
    let folder = folder.join(REPLAY_FOLDER);
    let chunks = record.chunks.iter().map(|name| read_chunk(&folder.join(name))).collect::<Result<_, _>>()?;
    Replay::restore(shape, chunks, record.state.frames_pushed).ok_or_else(|| CheckpointError::Replay {
        path: folder,
        reason: "its chunks do not hold the frames that the checkpoint counts".into(),
    })
}

fn read_chunk(path: &Path) -> Result<Chunk, CheckpointError> {
    let bytes = fs::read(path).map_err(|source| CheckpointError::Io { path: path.to_owned(), source })?;
    let damaged = |reason: String| CheckpointError::Replay { path: path.to_owned(), reason };
    let tensors = SafeTensors::deserialize(&bytes).map_err(|error| damaged(error.to_string()))?;
    let part = |name: &str, dtype: Dtype| {
        let view = tensors.tensor(name).map_err(|error| damaged(error.to_string()))?;
        if view.dtype() == dtype { Ok(view.data()) } else { Err(damaged(format!("{name} has another type"))) }
    };
    let floats = |name: &str| -> Result<Vec<f32>, CheckpointError> {
        Ok(part(name, Dtype::F32)?.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect())
    };
    Ok(Chunk {
        observations: floats("observations")?,
        actions: floats("actions")?,
        rewards: floats("rewards")?,
        ages: part("ages", Dtype::U32)?
            .as_chunks()
            .0
            .iter()
            .map(|&bytes| u32::from_le_bytes(bytes))
            .collect(),
        marks: part("marks", Dtype::U8)?.to_vec(),
    })
}
