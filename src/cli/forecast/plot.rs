//! `searoom forecast plot`: the paper's figures of forecasts, of any models.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, ValueEnum};

use super::data::OtherArea;
use super::figures::{self, Shown};
use crate::atomic_file;

/// Options of `searoom forecast plot`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom forecast plot AR1_prediction --model models/open-water-stochastic.safetensors --out ar1.svg
  searoom forecast plot prediction_rmse --out rmse.svg \\
      --model models/open-water-stochastic.safetensors --model models/open-water-periodic.safetensors
  searoom forecast plot traj_AIS_single_estimates \\
      --model models/coastal-ny-lower-bay.safetensors --out estimates.svg
  searoom forecast plot estimator_training --log runs/periodic/log.csv --out training.svg

`searoom experiment run` makes these figures of the shipped models, with their data.")]
pub struct PlotArgs {
    /// The figure, by the paper's name.
    #[arg(value_enum)]
    figure: FigureName,
    /// Trained models (safetensors), one panel each where a figure has several.
    #[arg(long)]
    model: Vec<PathBuf>,
    /// Logs of training runs (log.csv), for estimator_training.
    #[arg(long)]
    log: Vec<PathBuf>,
    #[command(flatten)]
    other: OtherArea,
    /// The SVG file to write.
    #[arg(long)]
    out: PathBuf,
    /// Segments to measure on.
    #[arg(long, default_value_t = 2000)]
    segments: usize,
    /// Seed of synthetic segments.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Names of the paper's figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(non_camel_case_types, reason = "the names are the paper's")]
enum FigureName {
    /// A forecast and backcast of a wandering vessel against the truth.
    #[value(name = "AR1_prediction")]
    Ar1Prediction,
    /// A forecast and backcast of a weaving vessel against the truth.
    #[value(name = "sinus_prediction")]
    SinusPrediction,
    /// Error quantiles over the horizon.
    #[value(name = "prediction_rmse")]
    PredictionRmse,
    /// Error quantiles over 200 steps in coastal waters.
    #[value(name = "quantile_forecast_vessel")]
    QuantileForecastVessel,
    /// Four forecasts against recorded tracks.
    #[value(name = "traj_AIS_single_estimates")]
    SingleEstimates,
    /// Loss over training.
    #[value(name = "estimator_training")]
    EstimatorTraining,
}

pub(super) fn run(args: &PlotArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let shown = Shown { models: &args.model, other: &args.other, segments: args.segments, seed: args.seed };
    let product = match args.figure {
        FigureName::EstimatorTraining => figures::training(&args.log)?,
        FigureName::Ar1Prediction | FigureName::SinusPrediction => shown.prediction()?,
        FigureName::SingleEstimates => shown.estimates()?,
        FigureName::PredictionRmse | FigureName::QuantileForecastVessel => shown.errors()?,
    };
    write_svg(&product.to_svg().map_err(anyhow::Error::from_boxed)?, &args.out)?;
    writeln!(out, "{}", args.out.display())?;
    Ok(())
}

/// Writes a figure as a whole.
pub(super) fn write_svg(svg: &str, path: &Path) -> anyhow::Result<()> {
    Ok(atomic_file::write(path, |file| file.write_all(svg.as_bytes()))?)
}
