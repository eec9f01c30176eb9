//! The forecasters of a benchmark, each loaded once.

use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::forecast::{Forecaster, LstmForecaster, Model};

/// The shipped forecaster of coastal waters.
pub(super) const SHIPPED: &str = "models/coastal-ny-lower-bay.safetensors";

/// Models by number.
pub(super) struct Forecasters {
    loaded: Vec<(PathBuf, Model)>,
}

impl Forecasters {
    pub(super) fn new() -> Self {
        Self { loaded: Vec::new() }
    }

    /// The number of the model in a file, which is read where it has not been yet.
    pub(super) fn number(&mut self, file: &Path) -> anyhow::Result<usize> {
        if let Some(number) = self.loaded.iter().position(|(loaded, _)| loaded == file) {
            return Ok(number);
        }
        let model = Model::open(file).with_context(|| {
            format!(
                "{}: no forecaster for the estimates; name one with --forecaster (paths are relative to the folder \
                 you are in)",
                file.display()
            )
        })?;
        self.loaded.push((file.to_owned(), model));
        Ok(self.loaded.len() - 1)
    }

    /// Whether there is a model of this number.
    pub(super) fn is_used(&self, number: usize) -> bool {
        number < self.loaded.len()
    }

    /// Files and models.
    pub(super) fn iter(&self) -> impl Iterator<Item = &(PathBuf, Model)> {
        self.loaded.iter()
    }

    /// A forecaster with this model, on one thread.
    pub(super) fn make(&self, number: usize) -> Box<dyn Forecaster> {
        Box::new(LstmForecaster::new(self.loaded[number].1.clone(), 1))
    }
}
