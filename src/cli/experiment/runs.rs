//! Folders of runs, in `results/` or of the user's own: learning curves and logs of trainings.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

use crate::config;
use crate::experiment::curves::{CONFIG, Curve, EVALUATIONS, ORIGIN, Origin, RunTexts};
use crate::experiment::estimator_training::TrainingLog;
use crate::forecast::ModelConfig;

/// Name of the log in the folder of a forecaster's training.
pub(super) const LOG: &str = "log.csv";

/// The folders in `folder` that hold `file`, by name.
pub(super) fn folders_with(folder: &Path, file: &str) -> anyhow::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error).with_context(|| folder.display().to_string()),
    };
    let mut folders = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.join(file).is_file() {
            folders.push(path);
        }
    }
    folders.sort();
    Ok(folders)
}

/// The learning curves of all agents' runs in `folder`; none where it is not there.
pub(super) fn curves(folder: &Path) -> anyhow::Result<Vec<Curve>> {
    folders_with(folder, EVALUATIONS)?.iter().map(|run| curve(run)).collect()
}

/// The learning curve of one agent's run.
pub(super) fn curve(run: &Path) -> anyhow::Result<Curve> {
    let texts = RunTexts {
        config: read(&run.join(CONFIG))?,
        evaluations: read(&run.join(EVALUATIONS))?,
        origin: read_optional(&run.join(ORIGIN))?,
    };
    Ok(Curve::parse(run, &texts)?)
}

/// The log of one forecaster's training.
pub(super) fn training_log(run: &Path) -> anyhow::Result<TrainingLog> {
    let path = run.join(CONFIG);
    let config: ModelConfig = config::load(&path)?;
    let log = run.join(LOG);
    Ok(TrainingLog::parse(config.name, &log, &read(&log)?, Some(config.training.seed), origin(run)?)?)
}

/// What trained a run, where its folder says so.
pub(super) fn origin(run: &Path) -> anyhow::Result<Option<Origin>> {
    let path = run.join(ORIGIN);
    let Some(text) = read_optional(&path)? else { return Ok(None) };
    let origin = toml::from_str(&text);
    Ok(Some(origin.with_context(|| format!("{}: it has to hold `version` and `commits`", path.display()))?))
}

pub(super) fn read(path: &Path) -> anyhow::Result<String> {
    fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))
}

fn read_optional(path: &Path) -> anyhow::Result<Option<String>> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => bail!("{}: {error}", path.display()),
    }
}
