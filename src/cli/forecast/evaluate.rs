//! `searoom forecast evaluate`: quantiles of the error on held-out segments.

use std::io::Write;
use std::path::PathBuf;

use anyhow::bail;
use clap::Args as ClapArgs;

use super::data::{self, HeldOut, OtherArea};
use super::plot;
use crate::cli::table::table;
use crate::experiment::forecasts::Measured;
use crate::experiment::prediction_rmse;
use crate::forecast::{
    BestLinearForecaster, DataConfig, Errors, Evaluation, EvaluationConfig, Forecaster, LstmForecaster,
    Model, NoiseErrors, Quantiles, RouteErrors, evaluate, quantiles_of,
};

/// Options of `searoom forecast evaluate`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom forecast evaluate --model models/coastal-ny-lower-bay.safetensors --plot errors.svg
  searoom forecast evaluate --model models/open-water-periodic.safetensors --json
  searoom forecast evaluate --model models/coastal-ny-lower-bay.safetensors \\
      --area ais/hampton-roads.toml --ais ais/hampton-roads-2020-06.csv.gz

The error of a segment is the root mean square distance to the truth over the horizon, in metres; the
table shows its quantiles over segments. The straight line is fitted to the same history.")]
pub struct EvaluateArgs {
    /// The trained model (safetensors).
    #[arg(long)]
    model: PathBuf,
    #[command(flatten)]
    other: OtherArea,
    /// Segments to measure on, spread evenly over all held-out ones.
    #[arg(long, default_value_t = 2000)]
    segments: usize,
    /// Steps to forecast [default: 100 in open water, 200 in coastal waters].
    #[arg(long)]
    horizon: Option<usize>,
    /// Seed of synthetic segments.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to compute on.
    #[arg(long, default_value_t = 1)]
    threads: usize,
    /// Draw the error over the horizon (SVG).
    #[arg(long)]
    plot: Option<PathBuf>,
    /// Print JSON instead of tables.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &EvaluateArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    if args.segments == 0 || args.horizon == Some(0) {
        bail!("--segments and --horizon have to be 1 or more");
    }
    let model = Model::open(&args.model)?;
    let horizon = args.horizon.unwrap_or(model.config.kind.horizon());
    let held_out = data::held_out(&model.config, &args.other, horizon, args.segments, args.seed)?;
    let mut forecaster = LstmForecaster::new(model, args.threads);
    let evaluation = measure(&mut forecaster, &held_out, &EvaluationConfig::default())?;
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&evaluation)?)?;
    } else {
        write_tables(&evaluation, out)?;
    }
    if let Some(path) = &args.plot {
        let measured = Measured::new(forecaster.model(), evaluation, args.other.area());
        let svg = prediction_rmse::make(&[measured]).to_svg().map_err(anyhow::Error::from_boxed)?;
        plot::write_svg(&svg, path)?;
    }
    Ok(())
}

/// Everything that is measured of a model: for a known process, the best linear predictor too.
pub(super) fn measure(
    forecaster: &mut LstmForecaster,
    held_out: &HeldOut,
    config: &EvaluationConfig,
) -> anyhow::Result<Evaluation> {
    let seen = |mmsi| held_out.seen.contains(&mmsi);
    let mut evaluation = evaluate(forecaster, &held_out.segments, &seen, config)?;
    if let DataConfig::Synthetic { process, segments } = &forecaster.model().config.data {
        let (history_len, horizon) = (forecaster.history_len(), evaluation.horizon_steps);
        if let Some(mut best) = BestLinearForecaster::new(*process, *segments, history_len, horizon) {
            evaluation.best_linear_rmse_m = Some(quantiles_of(&mut best, &held_out.segments, config)?);
        }
    }
    Ok(evaluation)
}

fn write_tables(evaluation: &Evaluation, out: &mut dyn Write) -> anyhow::Result<()> {
    let Evaluation { model, segments, horizon_steps, .. } = evaluation;
    writeln!(out, "{model}: error over {horizon_steps} steps in metres, quantiles over {segments} segments")?;
    let mut quantiles = table(1, &["", "25 %", "50 %", "75 %", "90 %"]);
    let mut line = |name: &str, q: &Quantiles| {
        let numbers = [q.q25, q.q50, q.q75, q.q90].map(|value| format!("{value:.1}"));
        quantiles.add_row([name.to_owned()].into_iter().chain(numbers));
    };
    line(model, &evaluation.rmse_m);
    if let Some(best) = &evaluation.best_linear_rmse_m {
        line("best linear predictor", best);
    }
    line("straight line", &evaluation.linear_rmse_m);
    writeln!(out, "{quantiles}")?;

    let mut medians = table(1, &["segments", "number", model, "straight line", "ratio"]);
    let mut line = |name: String, errors: &Errors| {
        medians.add_row([
            name,
            errors.segments.to_string(),
            format!("{:.1}", errors.rmse_m.q50),
            format!("{:.1}", errors.linear_rmse_m.q50),
            format!("{:.3}", errors.median_ratio),
        ]);
    };
    let all = Errors {
        segments: *segments,
        rmse_m: evaluation.rmse_m,
        linear_rmse_m: evaluation.linear_rmse_m,
        median_ratio: evaluation.median_ratio,
    };
    line("all".into(), &all);
    let subsets = [("with a curve", &evaluation.curve), ("unseen vessels", &evaluation.unseen_vessels)];
    for (name, errors) in subsets {
        errors.iter().for_each(|errors| line(name.into(), errors));
    }
    for NoiseErrors { sigma_m, errors } in &evaluation.noise {
        line(format!("noise of {sigma_m} m"), errors);
    }
    for RouteErrors { route, errors } in &evaluation.routes {
        line(format!("course {route}"), errors);
    }
    writeln!(out, "Medians:\n{medians}")?;
    if evaluation.fallbacks > 0 {
        writeln!(out, "{} forecasts fell back to the straight line", evaluation.fallbacks)?;
    }
    Ok(())
}
