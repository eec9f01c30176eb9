//! `--from-scratch`: trains what a figure needs, by the commands that anyone would give. What is there already is
//! gone on with, so that the same command resumes.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail, ensure};
use clap::Args as ClapArgs;

use super::inputs::InputArgs;
use super::runs::read;
use crate::atomic_file;
use crate::cli::forecast::figures;
use crate::config;
use crate::experiment::curves::Waters;
use crate::experiment::h_ablate::HISTORY_LENGTHS;
use crate::experiment::{COASTAL, Experiment, Needs, OPEN_WATER};
use crate::forecast::ModelConfig;

/// What is trained, and for how long.
#[derive(Debug, Clone, ClapArgs)]
pub(super) struct ScratchArgs {
    /// Train what the figure needs first, in the folder --runs [default there: runs]; the same command goes on
    #[arg(long)]
    from_scratch: bool,
    /// Steps of every run; of a forecaster, its updates [default: the paper's; of a forecaster, its own]
    #[arg(long, requires = "from_scratch")]
    steps: Option<u64>,
    /// Seeds 1 to N of every agent [default: the paper's]
    #[arg(long, requires = "from_scratch", value_name = "N")]
    seeds: Option<u64>,
    /// Runs at the same time, one core each [default: all cores]
    #[arg(long, requires = "from_scratch")]
    jobs: Option<usize>,
    /// Settings of every agent (TOML), as for searoom train --config
    #[arg(long, requires = "from_scratch", value_name = "FILE")]
    settings: Option<PathBuf>,
}

impl ScratchArgs {
    /// Trains what `experiment` needs, where that is asked for; figures are then made of these runs.
    pub fn prepare(&self, experiment: Experiment, inputs: &mut InputArgs) -> anyhow::Result<()> {
        if !self.from_scratch {
            return Ok(());
        }
        ensure!(self.steps != Some(0) && self.seeds != Some(0), "--steps and --seeds have to be 1 or more");
        let runs = inputs.runs.clone().unwrap_or_else(|| PathBuf::from("runs"));
        let (name, _, needs) = experiment.description();
        let open = [Waters::Stochastic, Waters::Periodic];
        match needs {
            Needs::Nothing => {}
            Needs::Forecasters(waters) => self.forecasters(waters, inputs, &runs)?,
            Needs::ForecasterLogs => self.forecasters(&open, inputs, &runs)?,
            Needs::CoastalForecaster => self.forecaster(inputs.coastal_file()?, &runs)?,
            Needs::Curves(waters) => self.sweep(name, waters, &["lstm-td3", "lstm-sac"], &[], &runs)?,
            Needs::Ablation => {
                self.sweep(name, &open, &["lstm-td3", "lstm-sac"], &HISTORY_LENGTHS, &runs)?;
            }
            Needs::Agents(waters) => self.sweep(name, &[waters], &["lstm-sac"], &[], &runs)?,
            Needs::NoiseBenchmark => {
                self.sweep(name, &[Waters::Coastal], &["lstm-td3", "lstm-sac"], &[], &runs)?;
                inputs.noise = Some(benchmark(&runs)?);
            }
        }
        inputs.runs = Some(runs);
        Ok(())
    }

    fn forecasters(&self, waters: &[Waters], inputs: &InputArgs, runs: &Path) -> anyhow::Result<()> {
        for file in inputs.open_water_files(waters)? {
            self.forecaster(file, runs)?;
        }
        Ok(())
    }

    /// Trains a forecaster as the one in `file` was, from random weights.
    fn forecaster(&self, file: PathBuf, runs: &Path) -> anyhow::Result<()> {
        let mut wanted = figures::forecaster(&file)?.model().config.clone();
        wanted.training.start_from = None;
        if let Some(steps) = self.steps {
            scale(&mut wanted, steps);
        }
        let run = runs.join(&wanted.name);
        let run_text = run.display().to_string();
        if run.join("checkpoint.safetensors").is_file() {
            let begun: ModelConfig = config::load(&run.join("config.toml"))?;
            ensure!(
                begun.training == wanted.training,
                "{run_text} has a training of {} updates under other settings: give another --runs or --steps",
                begun.training.total_steps()
            );
            return searoom(&["forecast", "train", "--out", &run_text, "--resume"], None);
        }
        let settings = runs.join(format!("{}.toml", wanted.name));
        write(&settings, &toml::to_string_pretty(&wanted)?)?;
        let settings = settings.display().to_string();
        searoom(&["forecast", "train", "--config", &settings, "--out", &run_text], None)
    }

    /// Trains agents with estimates and without as a sweep, whose file is left beside the runs.
    fn sweep(
        &self,
        name: &str,
        waters: &[Waters],
        algorithms: &[&str],
        history_lengths: &[usize],
        runs: &Path,
    ) -> anyhow::Result<()> {
        let is_coastal = waters.contains(&Waters::Coastal);
        let paper = if is_coastal { COASTAL } else { OPEN_WATER };
        let steps = i64::try_from(self.steps.unwrap_or(paper.steps)).context("--steps is too large")?;
        let seeds: Vec<i64> = (1..=i64::try_from(self.seeds.unwrap_or(paper.seeds))?).collect();
        let mut table = toml::Table::new();
        table.insert("out".into(), runs.display().to_string().into());
        table.insert("steps".into(), steps.into());
        table.insert("seeds".into(), seeds.into());
        table.insert("env".into(), vec![if is_coastal { "coastal" } else { "open-water" }].into());
        let motions: Vec<&str> = waters.iter().filter_map(|waters| waters.motion()).collect();
        if !motions.is_empty() {
            table.insert("motion".into(), motions.into());
        }
        table.insert("algorithm".into(), algorithms.to_vec().into());
        table.insert("estimates".into(), vec![true, false].into());
        if !history_lengths.is_empty() {
            let lengths: Vec<i64> = history_lengths.iter().map(|&length| length as i64).collect();
            table.insert("history_len".into(), lengths.into());
        }
        if let Some(file) = &self.settings {
            let settings: toml::Table = config::load(file)?;
            table.insert("settings".into(), settings.into());
        }
        let file = runs.join(format!("{name}.toml"));
        write(&file, &toml::to_string(&table)?)?;
        let file = file.display().to_string();
        let jobs = self.jobs.map(|jobs| jobs.to_string());
        let jobs = jobs.iter().flat_map(|jobs| ["--jobs", jobs]);
        searoom(&["sweep", &file].into_iter().chain(jobs).collect::<Vec<_>>(), None)
    }
}

/// Divides this many updates among the stages of a training as before.
fn scale(config: &mut ModelConfig, steps: u64) {
    let before = config.training.total_steps().max(1);
    let mut done = (0, 0);
    for stage in &mut config.training.stages {
        let until = done.0 + stage.steps;
        let scaled = (u128::from(until) * u128::from(steps) / u128::from(before)) as u64;
        stage.steps = scaled - done.1;
        done = (until, scaled);
    }
    config.training.stages.retain(|stage| stage.steps > 0);
}

/// Runs the noise benchmark over all coastal runs; gives the file of its table.
fn benchmark(runs: &Path) -> anyhow::Result<PathBuf> {
    let policies = super::runs::folders_with(runs, "policy.safetensors")?;
    let coastal = policies
        .iter()
        .filter(|run| super::runs::curve(run).is_ok_and(|curve| curve.run.waters == Waters::Coastal));
    let policies: Vec<String> = coastal.map(|run| run.display().to_string()).collect();
    let folder = runs.join("noise").display().to_string();
    let fixed = ["benchmark", "noise", "--json", "--out", &folder, "--policies"];
    let table = runs.join("noise_analysis.json");
    let arguments: Vec<&str> = fixed.into_iter().chain(policies.iter().map(String::as_str)).collect();
    searoom(&arguments, Some(&table))?;
    Ok(table)
}

/// Runs this program with other arguments, its output on the standard error stream or in a file.
fn searoom(arguments: &[&str], to: Option<&Path>) -> anyhow::Result<()> {
    let program = std::env::current_exe().context("cannot find the program itself")?;
    let told = arguments.join(" ");
    eprintln!("searoom {told}");
    let mut command = Command::new(program);
    command.args(arguments);
    let partial = to.map(|file| file.with_extension("partial"));
    command.stdout(match &partial {
        Some(file) => File::create(file).with_context(|| file.display().to_string())?.into(),
        None => Stdio::from(std::io::stderr()),
    });
    let status = command.status().with_context(|| format!("searoom {told}"))?;
    if !status.success() {
        bail!("searoom {told}: it did not succeed; what it said stands above");
    }
    if let (Some(partial), Some(to)) = (&partial, to) {
        write(to, &read(partial)?)?;
        std::fs::remove_file(partial).with_context(|| partial.display().to_string())?;
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    Ok(atomic_file::write(path, |file| file.write_all(text.as_bytes()))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn updates_are_divided_among_the_stages_as_before() {
        let text = "name = \"x\"\nkind = \"open-water\"\n[data.synthetic.process.periodic]\n[[training.stages]]\nsteps = 300\n\
                    [[training.stages]]\nsteps = 100\n[[training.stages]]\nsteps = 1\n";
        let mut config: ModelConfig = toml::from_str(text).unwrap();
        for (steps, expected) in [(40, vec![29, 10, 1]), (4010, vec![3000, 1000, 10]), (1, vec![1])] {
            let mut scaled = config.clone();
            scale(&mut scaled, steps);
            assert_eq!(scaled.training.total_steps(), steps);
            assert_eq!(scaled.training.stages.iter().map(|stage| stage.steps).collect::<Vec<_>>(), expected);
        }
        scale(&mut config, 401);
        assert_eq!(config.training.stages.len(), 3);
    }
}
