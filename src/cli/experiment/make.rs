//! `searoom experiment run`: makes figures and their data.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args as ClapArgs;

use super::from_scratch::ScratchArgs;
use super::inputs::{InputArgs, Situations};
use crate::atomic_file;
use crate::cli::forecast::figures;
use crate::env::coastal::CoastalConfig;
use crate::env::open_water::{MotionKind, OpenWater, OpenWaterConfig};
use crate::experiment::curves::Waters;
use crate::experiment::env_situations::Situation;
use crate::experiment::{
    Experiment, Needs, Product, architecture, coastal_results, env_example, env_situations,
    estimator_training, h_ablate, noise_analysis, recorded_trajectories, replacement, smoothing_distance,
    train_results,
};
use crate::rl::agent::AgentConfig;

/// Options of `searoom experiment run`.
#[derive(Debug, ClapArgs)]
#[command(after_help = "\
Examples:
  searoom experiment run prediction_rmse
  searoom experiment run all --out figures
  searoom experiment run trainResults --runs runs
  searoom experiment run trainResults --from-scratch --steps 150000 --seeds 3 --runs runs

Each figure is written as NAME.svg, its numbers as NAME.csv. What was run for it stands below it: steps, seeds and
commit as they are. Nothing is drawn that was not run; where all of it is missing, an error says which command makes it.")]
pub(super) struct RunArgs {
    /// Name of the figure (see `searoom experiment list`), or all
    #[arg(value_name = "NAME")]
    name: String,
    /// Folder to write into
    #[arg(long, default_value = "figures")]
    out: PathBuf,
    #[command(flatten)]
    inputs: InputArgs,
    #[command(flatten)]
    scratch: ScratchArgs,
    /// Print JSON: name, files and caption of each figure
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &RunArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let chosen = if args.name == "all" { Experiment::ALL.to_vec() } else { vec![named(&args.name)?] };
    ensure!(args.inputs.segments > 0, "--segments has to be 1 or more");
    let (mut made, mut missing) = (Vec::new(), Vec::new());
    for experiment in chosen {
        let name = experiment.name();
        let mut inputs = args.inputs.clone();
        let prepared = args.scratch.prepare(experiment, &mut inputs);
        let product = prepared.and_then(|()| make(experiment, &inputs));
        match product.and_then(|product| write(name, &product, &args.out)) {
            Ok(figure) => {
                if !args.json {
                    writeln!(out, "{}\n  {}", figure.svg.display(), figure.caption)?;
                }
                made.push(figure);
            }
            Err(error) if args.name == "all" => missing.push(format!("{name}: {error:#}")),
            Err(error) => return Err(error.context(name)),
        }
    }
    if args.json {
        let figures: Vec<_> = made
            .iter()
            .map(|figure| serde_json::json!({"name": figure.name, "svg": figure.svg, "csv": figure.csv, "caption": figure.caption}))
            .collect();
        writeln!(out, "{}", serde_json::to_string_pretty(&figures)?)?;
    }
    match &missing[..] {
        [] => Ok(()),
        missing => bail!(
            "{} of {} figures were not made:\n  {}",
            missing.len(),
            Experiment::ALL.len(),
            missing.join("\n  ")
        ),
    }
}

fn named(name: &str) -> anyhow::Result<Experiment> {
    Experiment::named(name).with_context(|| {
        let near = |experiment: &Experiment| {
            strsim::jaro_winkler(&experiment.name().to_lowercase(), &name.to_lowercase())
        };
        let best = Experiment::ALL.into_iter().max_by(|a, b| near(a).total_cmp(&near(b)));
        let best = best.map_or("", Experiment::name);
        format!("there is no figure \"{name}\"; did you mean {best}? `searoom experiment list` shows all")
    })
}

struct Figure {
    name: &'static str,
    svg: PathBuf,
    csv: PathBuf,
    caption: String,
}

fn write(name: &'static str, product: &Product, folder: &Path) -> anyhow::Result<Figure> {
    let svg_text = product.to_svg().map_err(anyhow::Error::from_boxed).context("cannot draw the figure")?;
    let (svg, csv) = (folder.join(format!("{name}.svg")), folder.join(format!("{name}.csv")));
    atomic_file::write(&csv, |file| product.data.write_csv(file))?;
    atomic_file::write(&svg, |file| file.write_all(svg_text.as_bytes()))?;
    Ok(Figure { name, svg, csv, caption: product.caption.clone() })
}

fn make(experiment: Experiment, inputs: &InputArgs) -> anyhow::Result<Product> {
    let (_, _, needs) = experiment.description();
    let (episode, seed) = (inputs.episode, inputs.seed());
    match experiment {
        Experiment::Architecture => Ok(architecture::make(
            &AgentConfig::default(),
            &OpenWaterConfig::default(),
            &CoastalConfig::default(),
        )),
        Experiment::EstimatorTraining => Ok(estimator_training::make(&inputs.training_logs()?)),
        Experiment::Ar1Prediction | Experiment::SinusPrediction | Experiment::PredictionRmse => {
            let Needs::Forecasters(waters) = needs else { bail!("it needs forecasters") };
            let models = inputs.open_water_files(waters)?;
            let shown = inputs.shown(&models);
            if experiment == Experiment::PredictionRmse { shown.errors() } else { shown.prediction() }
        }
        Experiment::SmoothingDistance => {
            let config = OpenWaterConfig { motion: MotionKind::Periodic, ..OpenWaterConfig::default() };
            let mut forecaster = figures::forecaster(&inputs.forecaster_file(Waters::Periodic.slug())?)?;
            smoothing_distance::make(&config, &mut forecaster, episode, seed)?.with_context(|| {
                other_episode(episode, "no obstacle with its CPA in the middle of the forecast")
            })
        }
        Experiment::EnvExample => {
            Ok(env_example::make(&mut OpenWater::new(OpenWaterConfig::default(), None)?, episode, seed)?)
        }
        Experiment::Replacement => replacement::make(&OpenWaterConfig::default(), episode, seed)
            .with_context(|| other_episode(episode, "no replacement")),
        Experiment::TrainResults => train_results::make(&inputs.curves()?)
            .with_context(|| no_curves(experiment, inputs, "runs of agents in open water")),
        Experiment::HAblate => h_ablate::make(&inputs.curves()?).with_context(|| {
            no_curves(experiment, inputs, "runs in the same waters with two lengths of the history")
        }),
        Experiment::AisResults => coastal_results::make(&inputs.curves()?)
            .with_context(|| no_curves(experiment, inputs, "runs of agents in coastal waters")),
        Experiment::EnvExampleAr1 | Experiment::EnvExampleSinus => {
            let Needs::Agents(waters) = needs else { bail!("it needs agents") };
            super::agents::in_episode(waters, inputs)
        }
        Experiment::EbeltoftTrajs => {
            let recorded = inputs.recorded(&figures::forecaster(&inputs.coastal_file()?)?)?;
            Ok(recorded_trajectories::make(&recorded.tracks, &recorded.plane, &recorded.area))
        }
        Experiment::TrajAisSingleEstimates => inputs.shown(&[inputs.coastal_file()?]).estimates(),
        Experiment::QuantileForecastVessel => inputs.shown(&[inputs.coastal_file()?]).errors(),
        Experiment::AisEnvSituations => {
            let config = CoastalConfig::default();
            let mut forecaster = figures::forecaster(&inputs.coastal_file()?)?;
            let Situations { tracks, openings } = inputs.situations(&forecaster, &config)?;
            let situations: Vec<Situation<'_>> = openings
                .iter()
                .map(|(episode, opening)| Situation {
                    opening,
                    track: &tracks[opening.start.track],
                    episode: *episode,
                })
                .collect();
            Ok(env_situations::make(&situations, &config, &mut forecaster)?)
        }
        Experiment::NoiseAnalysis => noise_analysis::make(&inputs.noise_rows()?)
            .context("the table of the noise benchmark has no rows"),
    }
}

fn other_episode(episode: u64, what: &str) -> String {
    format!("benchmark episode {episode} has {what}; choose another with --episode")
}

fn no_curves(experiment: Experiment, inputs: &InputArgs, what: &str) -> String {
    let name = experiment.name();
    let folder = inputs.curve_folder().display();
    let other = match inputs.runs {
        Some(_) => String::new(),
        None => " or your own runs with --runs DIR; finished ones are kept by searoom experiment collect"
            .to_owned(),
    };
    format!("{folder} has no {what}; train them with: searoom experiment run {name} --from-scratch{other}")
}
