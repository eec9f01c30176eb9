//! `searoom forecast plot`: the paper's figures of forecasts.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::{Args as ClapArgs, ValueEnum};

use super::data::{self, OtherArea};
use super::evaluate::measure;
use crate::atomic_file;
use crate::forecast::{
    EvaluationConfig, Forecaster, Forecasts, LstmForecaster, Model, ModelKind, Quantiles, Segment, StepErrors,
};
use crate::geo::Position;
use crate::nn::weights::WeightsFile;
use crate::report::figure::{Figure, Line, Panel, colour};

/// Options of `searoom forecast plot`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom forecast plot AR1_prediction --model models/open-water-stochastic.safetensors --out ar1.svg
  searoom forecast plot prediction_rmse --out rmse.svg \\
      --model models/open-water-stochastic.safetensors --model models/open-water-periodic.safetensors
  searoom forecast plot traj_AIS_single_estimates \\
      --model models/coastal-ny-lower-bay.safetensors --out estimates.svg
  searoom forecast plot estimator_training --log runs/periodic/log.csv --out training.svg")]
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
    let figure = match args.figure {
        FigureName::EstimatorTraining => training_figure(&args.log)?,
        FigureName::Ar1Prediction | FigureName::SinusPrediction => both_ways_figure(args)?,
        FigureName::SingleEstimates => estimates_figure(args)?,
        FigureName::PredictionRmse | FigureName::QuantileForecastVessel => error_figure(args)?,
    };
    write(&figure, &args.out)?;
    writeln!(out, "{}", args.out.display())?;
    Ok(())
}

/// Writes a figure as a whole.
pub(super) fn write(figure: &Figure, path: &Path) -> anyhow::Result<()> {
    let svg = figure.to_svg().map_err(|error| anyhow::anyhow!(error))?;
    Ok(atomic_file::write(path, |file| file.write_all(svg.as_bytes()))?)
}

fn models(args: &PlotArgs) -> anyhow::Result<Vec<LstmForecaster>> {
    if args.model.is_empty() {
        bail!("this figure needs a trained model: give --model FILE");
    }
    let load = |path: &PathBuf| Ok(LstmForecaster::new(Model::from_file(WeightsFile::open(path)?)?, 1));
    args.model.iter().map(load).collect()
}

fn error_figure(args: &PlotArgs) -> anyhow::Result<Figure> {
    let mut panels = Vec::new();
    for mut forecaster in models(args)? {
        let config = forecaster.model().config.clone();
        let held_out = data::held_out(&config, &args.other, config.kind.horizon(), args.segments, args.seed)?;
        let noiseless = EvaluationConfig { noise_m: Vec::new(), ..Default::default() };
        let evaluation = measure(&mut forecaster, &held_out, &noiseless)?;
        panels.push(error_panel(&config.name, config.dt_s(), evaluation.segments, &evaluation.steps));
    }
    Ok(Figure { columns: panels.len().min(2), panels })
}

/// Quantiles of the error at every step of the horizon.
pub(super) fn error_panel(name: &str, dt_s: f64, segments: usize, errors: &StepErrors) -> Panel {
    let series = |quantiles: &[Quantiles], of: fn(&Quantiles) -> f64| -> Vec<(f64, f64)> {
        let points = quantiles.iter().enumerate();
        points.map(|(k, quantiles)| ((k + 1) as f64 * dt_s / 60.0, of(quantiles))).collect()
    };
    let model = |of| series(&errors.model, of);
    Panel {
        title: format!("{name}, {segments} segments"),
        x_label: "time ahead (min)".into(),
        y_label: "error (m)".into(),
        lines: vec![
            Line::solid("straight line, 50 %", colour::GREY, series(&errors.linear, |q| q.q50)),
            Line::solid("90 %", colour::PURPLE, model(|q| q.q90)),
            Line::solid("75 %", colour::ORANGE, model(|q| q.q75)),
            Line::solid("50 %", colour::BLUE, model(|q| q.q50)),
            Line::solid("25 %", colour::GREEN, model(|q| q.q25)),
        ],
        ..Panel::default()
    }
}

/// One synthetic path whose middle is observed.
fn both_ways_figure(args: &PlotArgs) -> anyhow::Result<Figure> {
    let mut panels = Vec::new();
    for mut forecaster in models(args)? {
        let config = forecaster.model().config.clone();
        if config.kind != ModelKind::OpenWater {
            bail!("{} forecasts coastal traffic; this figure shows open water", config.name);
        }
        let (horizon, seen) = (config.kind.horizon(), config.kind.history_len());
        let path = data::synthetic_path(&config, horizon + seen + horizon, args.seed)?;
        let (past, rest) = path.split_at(horizon);
        let (observed, future) = rest.split_at(seen);
        let mut forecasts = Forecasts::new();
        forecaster.forecast_both_ways(&[observed], horizon, &mut forecasts)?;
        let forecast = [&observed[seen - 1..], forecasts.path(0)].concat();
        let backcast = [&observed[..1], forecasts.path(1)].concat();
        panels.push(map(
            config.name,
            vec![
                Line::solid("truth", colour::BLUE, points(&[past, observed, future].concat())),
                Line::solid("forecast", colour::ORANGE, points(&forecast)),
                Line::solid("backcast", colour::PURPLE, points(&backcast)),
                Line::dots("observed", colour::GREEN, points(observed)),
            ],
        ));
    }
    Ok(Figure { columns: panels.len().min(2), panels })
}

const ESTIMATES: usize = 4;

/// Forecasts of four held-out segments with a curve, evenly spread over all of those.
fn estimates_figure(args: &PlotArgs) -> anyhow::Result<Figure> {
    let mut forecasters = models(args)?;
    let [forecaster] = &mut forecasters[..] else { bail!("this figure shows one model: give --model once") };
    let config = forecaster.model().config.clone();
    let horizon = config.kind.horizon();
    let held_out = data::held_out(&config, &args.other, horizon, args.segments, args.seed)?;
    let curve_rad = EvaluationConfig::default().curve_deg.to_radians();
    let curves: Vec<&Segment> =
        held_out.segments.iter().filter(|segment| segment.has_curve(curve_rad)).collect();
    if curves.len() < ESTIMATES {
        bail!("only {} of the held-out segments have a curve; {ESTIMATES} are shown", curves.len());
    }
    let mut forecasts = Forecasts::new();
    let mut panels = Vec::new();
    for k in 0..ESTIMATES {
        let segment = curves[(2 * k + 1) * curves.len() / (2 * ESTIMATES)];
        forecaster.forecast(&[&segment.history], horizon, &mut forecasts)?;
        let way =
            |future: &[Position]| points(&[&segment.history[segment.history.len() - 1..], future].concat());
        panels.push(map(
            segment.route(),
            vec![
                Line::solid("truth", colour::BLUE, way(&segment.future)),
                Line::solid("forecast", colour::ORANGE, way(forecasts.path(0))),
                Line::solid("observed", colour::GREEN, points(&segment.history)),
            ],
        ));
    }
    Ok(Figure { panels, columns: 2 })
}

fn map(title: String, lines: Vec<Line>) -> Panel {
    Panel {
        title,
        x_label: "east (km)".into(),
        y_label: "north (km)".into(),
        lines,
        equal_scales: true,
        ..Panel::default()
    }
}

fn points(positions: &[Position]) -> Vec<(f64, f64)> {
    positions.iter().map(|position| (position.east_m / 1000.0, position.north_m / 1000.0)).collect()
}

fn training_figure(logs: &[PathBuf]) -> anyhow::Result<Figure> {
    if logs.is_empty() {
        bail!("estimator_training is drawn from the logs of training runs: give --log FILE");
    }
    let panels: Vec<Panel> = logs.iter().map(|log| training_panel(log)).collect::<anyhow::Result<_>>()?;
    Ok(Figure { columns: panels.len().min(2), panels })
}

fn training_panel(log: &Path) -> anyhow::Result<Panel> {
    let mut reader = csv::Reader::from_path(log).with_context(|| log.display().to_string())?;
    let mut losses = Vec::new();
    for row in reader.deserialize() {
        let (step, loss_m2, _, _): (f64, f64, f64, f64) = row.with_context(|| {
            format!(
                "{}: not the log of a training run (step,loss_m2,learning_rate,gradient_norm)",
                log.display()
            )
        })?;
        losses.push((step, loss_m2));
    }
    let run =
        log.parent().and_then(Path::file_name).map_or_else(String::new, |name| name.to_string_lossy().into());
    Ok(Panel {
        title: run,
        x_label: "updates".into(),
        y_label: "loss per displacement (m\u{b2})".into(),
        lines: vec![Line::solid("", colour::BLUE, losses)],
        logarithmic: true,
        ..Panel::default()
    })
}
