//! What a sweep trains: every combination of its grid, each a run with a name and a resolved configuration.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

use crate::agent::RunConfig;
use crate::config::Source;
use crate::env::EnvName;
use crate::env::open_water::MotionKind;
use crate::rl::agent::{AgentConfig, Algorithm};

/// A sweep file. Each list is an axis of the grid; an axis that is left out has one value, the default of
/// `settings`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SweepConfig {
    /// Folder that the runs' folders are in, relative to the folder the command is run in.
    #[serde(default = "default_out")]
    pub out: PathBuf,
    /// Decisions of every run.
    pub steps: u64,
    /// Seeds; every combination of the other axes is trained once with each.
    pub seeds: Vec<u64>,
    /// Environments.
    #[serde(default)]
    env: Vec<EnvName>,
    /// Motions of the obstacles; open water alone has them.
    #[serde(default)]
    motion: Vec<MotionKind>,
    /// Learning algorithms.
    #[serde(default)]
    algorithm: Vec<Algorithm>,
    /// Whether the observation holds estimates.
    #[serde(default)]
    estimates: Vec<bool>,
    /// Lengths of the history.
    #[serde(default)]
    history_len: Vec<usize>,
    /// Settings of every run, as in a file for `searoom train --config`.
    #[serde(default)]
    settings: toml::Table,
    /// Further axes: a key of the settings with dots, such as "trainer.agent.hidden", and its values.
    #[serde(default)]
    grid: BTreeMap<String, Vec<toml::Value>>,
}

fn default_out() -> PathBuf {
    "runs".into()
}

/// One run of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlannedRun {
    /// Its name without the seed: runs of one agent differ in their seeds alone.
    pub agent: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Its configuration.
    pub config: RunConfig,
    /// Values on the further axes, in the order of their keys.
    pub grid: Vec<String>,
}

impl PlannedRun {
    /// Name of the run and of its folder.
    pub fn name(&self) -> String {
        format!("{}-seed-{}", self.agent, self.config.trainer.seed)
    }
}

impl SweepConfig {
    /// Reads a sweep file.
    pub fn load(file: &Path) -> anyhow::Result<Self> {
        let source = Source::read(file)?;
        let config: Self = source.parse()?;
        if config.seeds.is_empty() {
            bail!("{}: `seeds` is empty: name one seed at least", file.display());
        }
        for (key, values) in &config.grid {
            if values.is_empty() {
                bail!("{}: `grid.{key}` is empty: give it values or leave it out", file.display());
            }
        }
        let settings = config.settings().with_context(|| file.display().to_string())?;
        settings.check().map_err(|fault| source.located(fault.within("settings")))?;
        Ok(config)
    }

    /// Keys of the further axes.
    pub fn grid_keys(&self) -> impl Iterator<Item = &str> {
        self.grid.keys().map(String::as_str)
    }

    /// All runs, those of one agent one after the other by seed.
    pub fn runs(&self) -> anyhow::Result<Vec<PlannedRun>> {
        let base = self.settings()?;
        let mut runs = Vec::new();
        for env in or_default(&self.env, base.env) {
            let motions = or_default(&self.motion, base.open_water.motion);
            // Recorded vessels move as they did.
            let motions = if env == EnvName::Coastal { &motions[..1] } else { &motions };
            for &motion in motions {
                for history_len in or_default(&self.history_len, base.trainer.agent.history_len) {
                    for algorithm in or_default(&self.algorithm, base.trainer.agent.algorithm) {
                        for estimates in or_default(&self.estimates, base.estimates) {
                            let point = Point { env, motion, history_len, algorithm, estimates };
                            self.add_runs(point, &mut runs)?;
                        }
                    }
                }
            }
        }
        Ok(runs)
    }

    /// The runs of one combination of the named axes: every combination of the further ones, every seed.
    fn add_runs(&self, point: Point, runs: &mut Vec<PlannedRun>) -> anyhow::Result<()> {
        for choice in self.grid_choices() {
            let mut overrides = toml::Table::new();
            overrides.insert("env".into(), toml::Value::try_from(point.env)?);
            for (key, value) in &choice {
                set(&mut overrides, key, value).with_context(|| format!("`grid.{key}`"))?;
            }
            let mut config = self.resolve(&overrides).with_context(|| {
                let keys: Vec<&str> = choice.iter().map(|(key, _)| *key).collect();
                format!("`settings` with `grid` ({})", keys.join(", "))
            })?;
            config.steps = self.steps;
            config.open_water.motion = point.motion;
            config.trainer.agent.history_len = point.history_len;
            config.trainer.agent.algorithm = point.algorithm;
            config.estimates = point.estimates;
            let agent = agent_name(&config, &choice);
            config.check().with_context(|| agent.clone())?;
            for &seed in &self.seeds {
                let mut config = config.clone();
                config.trainer.seed = seed;
                let run = PlannedRun {
                    folder: PathBuf::new(),
                    agent: agent.clone(),
                    grid: choice.iter().map(|(_, value)| value.to_string()).collect(),
                    config,
                };
                let folder = self.out.join(run.name());
                if runs.iter().any(|other| other.folder == folder) {
                    bail!(
                        "two runs are called {}: name each value of an axis, and each seed, once",
                        run.name()
                    );
                }
                runs.push(PlannedRun { folder, ..run });
            }
        }
        Ok(())
    }

    /// Every combination of the further axes; one empty choice where there are none.
    fn grid_choices(&self) -> Vec<Vec<(&str, &toml::Value)>> {
        self.grid.iter().fold(vec![Vec::new()], |choices, (key, values)| {
            let longer = |choice: &Vec<_>| {
                let with = |value| choice.iter().copied().chain([(key.as_str(), value)]).collect::<Vec<_>>();
                values.iter().map(with).collect::<Vec<_>>()
            };
            choices.iter().flat_map(longer).collect()
        })
    }

    /// The settings of every run; what they do not say is the default.
    fn settings(&self) -> anyhow::Result<RunConfig> {
        self.resolve(&toml::Table::new()).context("`settings`")
    }

    /// The settings with `overrides` on top; what neither says is the default.
    fn resolve(&self, overrides: &toml::Table) -> anyhow::Result<RunConfig> {
        let mut table = self.settings.clone();
        merge(&mut table, overrides);
        Ok(RunConfig::from_table(&table)?)
    }
}

/// A combination of the named axes.
#[derive(Debug, Clone, Copy)]
struct Point {
    env: EnvName,
    motion: MotionKind,
    history_len: usize,
    algorithm: Algorithm,
    estimates: bool,
}

fn or_default<T: Clone>(axis: &[T], default: T) -> Vec<T> {
    if axis.is_empty() { vec![default] } else { axis.to_vec() }
}

/// `open-water-stochastic-lstm-td3-h7-baseline`: only what is not the default is spelled out after the algorithm.
fn agent_name(config: &RunConfig, choice: &[(&str, &toml::Value)]) -> String {
    let mut name = match config.env {
        EnvName::OpenWater => format!("{}-{}", word(config.env), word(config.open_water.motion)),
        EnvName::Coastal => word(config.env),
    };
    name += &format!("-{}", word(config.trainer.agent.algorithm));
    if config.trainer.agent.history_len != AgentConfig::default().history_len {
        name += &format!("-h{}", config.trainer.agent.history_len);
    }
    if !config.estimates {
        name += "-baseline";
    }
    for (key, value) in choice {
        let key = key.rsplit('.').next().unwrap_or(key);
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        let value: String = value.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
        name += &format!("-{key}-{value}");
    }
    name
}

/// The name that a value has in files.
pub(super) fn word(value: impl Serialize) -> String {
    toml::Value::try_from(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Sets a dotted key.
fn set(table: &mut toml::Table, key: &str, value: &toml::Value) -> anyhow::Result<()> {
    let (path, last) = key.rsplit_once('.').map_or((None, key), |(path, last)| (Some(path), last));
    let mut inner = table;
    for part in path.iter().flat_map(|path| path.split('.')) {
        let entry = inner.entry(part).or_insert_with(|| toml::Table::new().into());
        inner = entry.as_table_mut().context("a part of this key is a value, not a table")?;
    }
    inner.insert(last.to_owned(), value.clone());
    Ok(())
}

/// Puts `from` on top of `table`, table by table.
fn merge(table: &mut toml::Table, from: &toml::Table) {
    for (key, value) in from {
        match (table.get_mut(key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(value)) => merge(inner, value),
            _ => {
                table.insert(key.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(text: &str) -> SweepConfig {
        toml::from_str(text).unwrap()
    }

    fn names(text: &str) -> Vec<String> {
        sweep(text).runs().unwrap().iter().map(PlannedRun::name).collect()
    }

    #[test]
    fn every_combination_is_a_run_with_its_own_name() {
        let names = names(
            "steps = 10\nseeds = [1, 2]\nenv = [\"open-water\", \"coastal\"]\nmotion = [\"stochastic\", \"periodic\"]\n\
             algorithm = [\"lstm-td3\"]\nestimates = [true, false]\nhistory_len = [4, 7]\n",
        );
        // Two motions and one area, two histories, with and without estimates, two seeds.
        assert_eq!(names.len(), 3 * 2 * 2 * 2);
        assert_eq!(names[0], "open-water-stochastic-lstm-td3-seed-1");
        for name in [
            "open-water-periodic-lstm-td3-h7-baseline-seed-2",
            "coastal-lstm-td3-baseline-seed-1",
            "coastal-lstm-td3-h7-seed-2",
        ] {
            assert_eq!(names.iter().filter(|other| *other == name).count(), 1, "{name}: {names:?}");
        }
    }

    #[test]
    fn settings_and_the_grid_reach_the_configuration() {
        let sweep = sweep(
            "steps = 10\nseeds = [3]\nenv = [\"coastal\"]\n[settings.trainer.agent]\nhidden = 16\n\
             [grid]\n\"coastal.noise_m\" = [0.0, 5.0]\n\"trainer.agent.sac.discount\" = [0.9]\n",
        );
        let runs = sweep.runs().unwrap();
        assert_eq!(runs.len(), 2);
        assert_eq!(runs[1].name(), "coastal-lstm-sac-noise_m-5.0-discount-0.9-seed-3");
        let config = &runs[1].config;
        assert_eq!((config.coastal.noise_m, config.trainer.agent.hidden), (5.0, 16));
        assert_eq!((config.trainer.agent.sac.discount, config.trainer.seed, config.steps), (0.9, 3, 10));
        // What is not set is the default of the environment.
        assert_eq!(config.trainer.evaluate_every, RunConfig::of(EnvName::Coastal).trainer.evaluate_every);
        assert_eq!(sweep.grid_keys().collect::<Vec<_>>(), ["coastal.noise_m", "trainer.agent.sac.discount"]);
    }

    #[test]
    fn what_cannot_be_trained_is_told() {
        let error = |text: &str| format!("{:#}", sweep(text).runs().unwrap_err());
        let unknown = error("steps = 1\nseeds = [1]\n[grid]\n\"trainer.seeed\" = [1]\n");
        assert!(unknown.contains("seeed") && unknown.contains("grid"), "{unknown}");
        let wrong = error("steps = 1\nseeds = [1]\n[settings]\nestimates = 3\n");
        assert!(wrong.contains("settings") && wrong.contains("boolean"), "{wrong}");
        let twice = error("steps = 1\nseeds = [1, 1]\n");
        assert!(twice.contains("two runs are called open-water-stochastic-lstm-sac-seed-1"), "{twice}");
        let inner = error("steps = 1\nseeds = [1]\n[grid]\n\"env.name\" = [1]\n");
        assert!(inner.contains("not a table"), "{inner}");
        let none = error("steps = 0\nseeds = [1]\n");
        assert!(none.contains("open-water-stochastic-lstm-sac: steps: 0 is not possible"), "{none}");
        let axis = error("steps = 1\nseeds = [1]\n[grid]\n\"trainer.agent.sac.discount\" = [0.9, 2.0]\n");
        assert!(axis.contains("discount-2.0: trainer.agent.sac.discount: 2 is not possible"), "{axis}");
    }

    #[test]
    fn a_number_that_no_run_can_work_with_is_named_by_line() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("sweep.toml");
        std::fs::write(&file, "steps = 1\nseeds = [1]\n[settings.trainer]\nreplay_capacity = 0\n").unwrap();
        let error = SweepConfig::load(&file).unwrap_err().to_string();
        assert!(
            error.contains("sweep.toml:4: key \"settings.trainer.replay_capacity\": 0 is not"),
            "{error}"
        );
    }
}
