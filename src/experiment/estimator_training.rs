//! `estimator_training`: loss of the forecasters over training (paper, section "Trajectory prediction").

use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use super::curves::{Origin, thousands};
use super::product::{DataTable, Drawing, Product, data_row};
use crate::report::figure::{Figure, Line, Panel, colour};

/// Why a file is no log of a forecaster's training.
#[derive(Debug, Error)]
#[error(
    "{}: {reason}; it has to be the log.csv that `searoom forecast train` wrote (step,loss_m,learning_rate,gradient_norm)",
    path.display()
)]
pub struct LogError {
    path: PathBuf,
    reason: String,
}

/// A line of the log: means over the updates since the line before.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct LogLine {
    /// Updates made.
    pub step: u64,
    /// Loss in metres: of a displacement in the first stage, of a whole path in those that unroll.
    pub loss_m: f64,
    /// Learning rate.
    pub learning_rate: f64,
    /// Norm of the gradient.
    pub gradient_norm: f64,
}

/// The training of one forecaster.
#[derive(Debug, Clone)]
pub struct TrainingLog {
    /// Name of its run.
    pub name: String,
    /// The log.
    pub lines: Vec<LogLine>,
    /// Seed of the run, where it is known.
    pub seed: Option<u64>,
    /// What trained it, where it is known.
    pub origin: Option<Origin>,
}

impl TrainingLog {
    /// Reads the text of a log.
    ///
    /// # Errors
    ///
    /// When it is something else, or has no line.
    pub fn parse(
        name: String,
        path: &Path,
        text: &str,
        seed: Option<u64>,
        origin: Option<Origin>,
    ) -> Result<Self, LogError> {
        let wrong = |reason: String| LogError { path: path.to_owned(), reason };
        let rows = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
        let lines: Vec<LogLine> = rows.collect::<Result<_, _>>().map_err(|error| wrong(error.to_string()))?;
        if lines.is_empty() {
            return Err(wrong("it has no line yet".into()));
        }
        Ok(Self { name, lines, seed, origin })
    }
}

/// One panel for each log.
#[must_use]
pub fn make(logs: &[TrainingLog]) -> Product {
    let mut data = DataTable::new(&["run", "step", "loss_m", "learning_rate", "gradient_norm"]);
    let (mut panels, mut ran) = (Vec::new(), Vec::new());
    for log in logs {
        for line in &log.lines {
            data.push(data_row![
                log.name.as_str(),
                line.step,
                line.loss_m,
                line.learning_rate,
                line.gradient_norm
            ]);
        }
        let losses = log.lines.iter().map(|line| (line.step as f64 / 1000.0, line.loss_m)).collect();
        panels.push(Panel {
            title: log.name.clone(),
            x_label: "updates (thousands)".into(),
            y_label: "loss (m)".into(),
            lines: vec![Line::solid("", colour::BLUE, losses)],
            logarithmic: true,
            ..Panel::default()
        });
        let updates = log.lines.last().map_or(0, |line| line.step);
        let seed = log.seed.map_or_else(|| "seed not recorded".to_owned(), |seed| format!("seed {seed}"));
        let commit = match &log.origin {
            Some(origin) => format!("commit {}", origin.short_commits()),
            None => "commit not recorded".to_owned(),
        };
        ran.push(format!("{}: {} updates, {seed}, {commit}", log.name, thousands(updates)));
    }
    let columns = panels.len().min(2);
    let caption = format!(
        "Training loss of a forecaster, averaged between two lines of the log: root mean square error of a displacement or, \
         in the stages that learn whole paths, their mean error; it steps where such a stage begins. {}.",
        ran.join("; ")
    );
    Product { drawing: Drawing::Figure(Figure { panels, columns }), data, caption }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_drawn_and_told() {
        let text = "step,loss_m,learning_rate,gradient_norm\n50,120.5,0.001,3.5\n100,20.5,0.002,2.5\n";
        let parse = |text: &str| {
            TrainingLog::parse("periodic".into(), Path::new("runs/periodic/log.csv"), text, Some(1), None)
        };
        let product = make(&[parse(text).unwrap(), parse(text).unwrap()]);
        assert_eq!(product.data.rows().len(), 4);
        assert!(
            product.caption.contains("periodic: 100 updates, seed 1, commit not recorded"),
            "{}",
            product.caption
        );
        assert!(product.to_svg().unwrap().contains("loss (m)"));
        for text in ["", "step,loss\n1,2\n", "step,loss_m,learning_rate,gradient_norm\n1,x,2,3\n"] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains("runs/periodic/log.csv") && error.contains("forecast train"), "{error}");
        }
    }
}
