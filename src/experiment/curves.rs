//! Learning curves: the evaluations of training runs, each with what was trained and by which commit.
//!
//! A finished run is kept as three small files in a folder of its name:
//!
//! | file | content |
//! | --- | --- |
//! | `evaluations.csv` | `step,mean_return,sd_return,mean_decisions,episodes`, a line per evaluation |
//! | `config.toml` | every setting in use |
//! | `origin.toml` | `version` of the program and `commits` that the run was trained with |
//!
//! They are those of the run's own folder. What a curve shows is read from `config.toml`, never from the
//! folder's name; only the keys needed here are read, so that older results stay readable.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::statistics::{self, Estimate};
use crate::env::open_water::MotionKind;
use crate::rl::agent::{AgentConfig, Algorithm};

/// Name of the file of evaluations.
pub const EVALUATIONS: &str = "evaluations.csv";
/// Name of the file of settings.
pub const CONFIG: &str = "config.toml";
/// Name of the file that says what trained the run.
pub const ORIGIN: &str = "origin.toml";

/// Where a run was trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Waters {
    /// Open water, obstacles that wander.
    Stochastic,
    /// Open water, obstacles that weave.
    Periodic,
    /// Coastal waters.
    Coastal,
}

impl Waters {
    /// As it stands in names of runs.
    #[must_use]
    pub fn slug(self) -> &'static str {
        match self {
            Self::Stochastic => "open-water-stochastic",
            Self::Periodic => "open-water-periodic",
            Self::Coastal => "coastal",
        }
    }

    /// The motion of the obstacles as settings name it; none where they replay what was recorded.
    #[must_use]
    pub fn motion(self) -> Option<&'static str> {
        match self {
            Self::Stochastic => Some("stochastic"),
            Self::Periodic => Some("periodic"),
            Self::Coastal => None,
        }
    }

    /// As it stands above panels.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Stochastic => "Stochastic obstacle movement",
            Self::Periodic => "Periodic obstacle movement",
            Self::Coastal => "Coastal head-on encounters",
        }
    }
}

/// One of the four agents that the paper compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AgentKind {
    /// The learning algorithm.
    pub algorithm: Algorithm,
    /// Whether it sees estimates of the collision risk.
    pub estimates: bool,
}

impl AgentKind {
    /// All four, as legends list them.
    pub const ALL: [Self; 4] = [
        Self { algorithm: Algorithm::LstmTd3, estimates: true },
        Self { algorithm: Algorithm::LstmSac, estimates: true },
        Self { algorithm: Algorithm::LstmTd3, estimates: false },
        Self { algorithm: Algorithm::LstmSac, estimates: false },
    ];

    /// The paper's name: with the prefix `SL` where it sees estimates.
    #[must_use]
    pub fn label(self) -> &'static str {
        match (self.algorithm, self.estimates) {
            (Algorithm::LstmTd3, true) => "SL-LSTM-TD3",
            (Algorithm::LstmSac, true) => "SL-LSTM-SAC",
            (Algorithm::LstmTd3, false) => "LSTM-TD3",
            (Algorithm::LstmSac, false) => "LSTM-SAC",
        }
    }

    /// As it stands in names of runs: `lstm-td3`, `lstm-sac-baseline`, `lstm-td3-h7-baseline`.
    #[must_use]
    pub fn slug(self, history_len: usize) -> String {
        let algorithm = match self.algorithm {
            Algorithm::LstmTd3 => "lstm-td3",
            Algorithm::LstmSac => "lstm-sac",
        };
        let history = match history_len {
            length if length == AgentConfig::default().history_len => String::new(),
            length => format!("-h{length}"),
        };
        let baseline = if self.estimates { "" } else { "-baseline" };
        format!("{algorithm}{history}{baseline}")
    }
}

/// The name of a run: `coastal-lstm-sac-seed-1`, `open-water-periodic-lstm-td3-h7-baseline-seed-2`.
#[must_use]
pub fn run_name(waters: Waters, agent: AgentKind, history_len: usize, seed: u64) -> String {
    format!("{}-{}-seed-{seed}", waters.slug(), agent.slug(history_len))
}

/// Which program trained a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// Commits it was built from: more than one where a run was resumed with another.
    pub commits: Vec<String>,
}

impl Origin {
    /// The commits in short.
    #[must_use]
    pub fn short_commits(&self) -> String {
        self.commits.iter().map(|commit| short(commit)).collect::<Vec<_>>().join(", ")
    }
}

/// The first letters of a commit: enough to find it by.
fn short(commit: &str) -> &str {
    commit.get(..10).unwrap_or(commit)
}

/// What of a run's settings a figure depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct RunFacts {
    /// Name of its folder.
    pub name: String,
    /// Where it was trained.
    pub waters: Waters,
    /// The agent.
    pub agent: AgentKind,
    /// Length of its history.
    pub history_len: usize,
    /// Seed.
    pub seed: u64,
    /// Steps to be trained.
    pub steps: u64,
    /// Steps between two evaluations.
    pub evaluate_every: u64,
    /// What trained it; nothing where the folder does not say.
    pub origin: Option<Origin>,
}

/// One evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct CurvePoint {
    /// Steps trained before it.
    pub step: u64,
    /// Mean return of its episodes.
    pub mean_return: f64,
    /// Standard deviation over its episodes.
    pub sd_return: Option<f64>,
    /// Its episodes.
    pub episodes: f64,
}

/// The learning curve of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// What was run.
    pub run: RunFacts,
    /// The evaluations, by step.
    pub points: Vec<CurvePoint>,
}

/// Why a run's files tell no learning curve.
#[derive(Debug, Error)]
pub enum CurveError {
    /// The settings.
    #[error("{}: {reason}; it has to be the config.toml that `searoom train` wrote", path.display())]
    Config {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The evaluations.
    #[error("{}: {reason}; it has to be the evaluations.csv that `searoom train` wrote", path.display())]
    Evaluations {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the line.
        reason: String,
    },
    /// What trained it.
    #[error("{}: {reason}; it has to hold `version` and `commits`", path.display())]
    Origin {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// The texts of a run's files.
#[derive(Debug, Clone)]
pub struct RunTexts {
    /// `config.toml`.
    pub config: String,
    /// `evaluations.csv`.
    pub evaluations: String,
    /// `origin.toml`, where there is one.
    pub origin: Option<String>,
}

#[derive(Deserialize)]
struct Settings {
    env: String,
    estimates: bool,
    steps: u64,
    open_water: OpenWaterSettings,
    trainer: TrainerSettings,
}

#[derive(Deserialize)]
struct OpenWaterSettings {
    motion: MotionKind,
}

#[derive(Deserialize)]
struct TrainerSettings {
    seed: u64,
    evaluate_every: u64,
    agent: AgentSettings,
}

#[derive(Deserialize)]
struct AgentSettings {
    algorithm: Algorithm,
    history_len: usize,
}

impl Curve {
    /// Reads the files of the run in `folder`, which gives the run its name.
    ///
    /// # Errors
    ///
    /// When one of them is not what `searoom train` writes.
    pub fn parse(folder: &Path, texts: &RunTexts) -> Result<Self, CurveError> {
        let path = folder.join(CONFIG);
        let settings: Settings = toml::from_str(&texts.config)
            .map_err(|error| CurveError::Config { path: path.clone(), reason: error.message().to_owned() })?;
        let waters = match (settings.env.as_str(), settings.open_water.motion) {
            ("coastal", _) => Waters::Coastal,
            ("open-water", MotionKind::Stochastic) => Waters::Stochastic,
            ("open-water", MotionKind::Periodic) => Waters::Periodic,
            (other, _) => {
                let reason = format!("`env` is \"{other}\", neither \"open-water\" nor \"coastal\"");
                return Err(CurveError::Config { path, reason });
            }
        };
        let origin = texts.origin.as_deref().map(|text| {
            toml::from_str(text).map_err(|error| CurveError::Origin {
                path: folder.join(ORIGIN),
                reason: error.message().to_owned(),
            })
        });
        let trainer = settings.trainer;
        let run = RunFacts {
            name: folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            waters,
            agent: AgentKind { algorithm: trainer.agent.algorithm, estimates: settings.estimates },
            history_len: trainer.agent.history_len,
            seed: trainer.seed,
            steps: settings.steps,
            evaluate_every: trainer.evaluate_every,
            origin: origin.transpose()?,
        };
        Ok(Self { run, points: points(&folder.join(EVALUATIONS), &texts.evaluations)? })
    }

    /// The step of the last evaluation.
    #[must_use]
    pub fn last_step(&self) -> Option<u64> {
        self.points.last().map(|point| point.step)
    }

    /// Whether the run reached its end: no further evaluation was due.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.last_step().is_some_and(|last| last + self.run.evaluate_every > self.run.steps)
    }

    pub(super) fn at(&self, step: u64) -> Option<f64> {
        let index = self.points.binary_search_by_key(&step, |point| point.step).ok()?;
        Some(self.points[index].mean_return)
    }
}

fn points(path: &Path, text: &str) -> Result<Vec<CurvePoint>, CurveError> {
    let wrong = |reason: String| CurveError::Evaluations { path: path.to_owned(), reason };
    let mut points: Vec<CurvePoint> = Vec::new();
    for row in csv::Reader::from_reader(text.as_bytes()).deserialize() {
        let point: CurvePoint = row.map_err(|error| wrong(error.to_string()))?;
        if points.last().is_some_and(|last| last.step >= point.step) {
            return Err(wrong(format!("step {} does not come after the one before it", point.step)));
        }
        points.push(point);
    }
    Ok(points)
}

/// The runs of one agent under the same settings, all seeds.
#[derive(Debug, Clone)]
pub struct Group<'a> {
    /// The agent.
    pub agent: AgentKind,
    /// Its runs, by seed.
    pub curves: Vec<&'a Curve>,
}

/// Return over seeds at one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroupPoint {
    /// Steps trained.
    pub step: u64,
    /// Mean over seeds with Student's t-interval.
    pub mean_return: Estimate,
}

impl<'a> Group<'a> {
    /// The runs of `agent` in these waters with this history, one for each seed: of several with one seed
    /// the longest.
    #[must_use]
    pub fn of(curves: &'a [Curve], waters: Waters, agent: AgentKind, history_len: usize) -> Self {
        let belongs = |curve: &&Curve| {
            let run = &curve.run;
            run.waters == waters && run.agent == agent && run.history_len == history_len
        };
        let mut chosen: Vec<&Curve> = curves.iter().filter(belongs).collect();
        chosen.sort_by_key(|curve| (curve.run.seed, std::cmp::Reverse(curve.last_step())));
        chosen.dedup_by_key(|curve| curve.run.seed);
        chosen.retain(|curve| !curve.points.is_empty());
        Self { agent, curves: chosen }
    }

    /// Mean and interval over seeds at every step that all of them were evaluated at.
    #[must_use]
    pub fn points(&self) -> Vec<GroupPoint> {
        let Some(first) = self.curves.first() else { return Vec::new() };
        let at = |step: u64| -> Option<GroupPoint> {
            let returns: Option<Vec<f64>> = self.curves.iter().map(|curve| curve.at(step)).collect();
            let mean_return = statistics::mean(&returns?, statistics::CONFIDENCE)?;
            Some(GroupPoint { step, mean_return })
        };
        first.points.iter().filter_map(|point| at(point.step)).collect()
    }

    /// As captions state it: `SL-LSTM-SAC: 3 seeds, 150,000 steps`, with a note where runs are under way.
    #[must_use]
    pub fn description(&self) -> String {
        let last = self.points().last().map_or(0, |point| point.step);
        let seeds = self.curves.len();
        let unfinished = self.curves.iter().filter(|curve| !curve.is_finished()).count();
        let note = if unfinished > 0 { format!(" ({unfinished} not finished)") } else { String::new() };
        format!("{}: {}, {} steps{note}", self.agent.label(), counted(seeds, "seed"), thousands(last))
    }
}

/// The commits that trained these runs, as captions state them.
#[must_use]
pub fn commits<'a>(curves: impl IntoIterator<Item = &'a Curve>) -> String {
    let mut known: Vec<&str> = Vec::new();
    let mut has_unknown = false;
    for curve in curves {
        match &curve.run.origin {
            Some(origin) => known.extend(origin.commits.iter().map(|commit| short(commit))),
            None => has_unknown = true,
        }
    }
    known.sort_unstable();
    known.dedup();
    match (known.is_empty(), has_unknown) {
        (true, _) => "commit not recorded".to_owned(),
        (false, true) => format!("commit {}, of some runs not recorded", known.join(", ")),
        (false, false) => format!("commit {}", known.join(", ")),
    }
}

/// `1 seed`, `3 seeds`.
#[must_use]
pub fn counted(many: usize, what: &str) -> String {
    format!("{many} {what}{}", if many == 1 { "" } else { "s" })
}

/// `150,000`.
#[must_use]
pub fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A run whose return at every step is `level + slope * step`.
    pub(crate) fn run(
        waters: Waters,
        agent: AgentKind,
        history_len: usize,
        seed: u64,
        level: f64,
        steps: u64,
    ) -> Curve {
        let (env, motion) = match waters {
            Waters::Coastal => ("coastal", "stochastic"),
            Waters::Stochastic => ("open-water", "stochastic"),
            Waters::Periodic => ("open-water", "periodic"),
        };
        let algorithm = agent.slug(AgentConfig::default().history_len).replace("-baseline", "");
        let config = format!(
            "env = \"{env}\"\nsteps = {steps}\nestimates = {}\nforecaster = \"x\"\n[open_water]\nmotion = \"{motion}\"\n\
             decisions = 500\n[trainer]\nseed = {seed}\nevaluate_every = 100\n[trainer.agent]\n\
             algorithm = \"{algorithm}\"\nhistory_len = {history_len}\n",
            agent.estimates
        );
        let mut evaluations = "step,mean_return,sd_return,mean_decisions,episodes\n".to_owned();
        for step in (100..=steps).step_by(100) {
            let mean = level + seed as f64 + 0.01 * step as f64;
            evaluations += &format!("{step},{mean},1.5,500,10\n");
        }
        let origin = Some("version = \"0.1.0\"\ncommits = [\"0123456789abcdef\"]\n".to_owned());
        let name = run_name(waters, agent, history_len, seed);
        Curve::parse(Path::new(&name), &RunTexts { config, evaluations, origin }).unwrap()
    }

    const SAC: AgentKind = AgentKind { algorithm: Algorithm::LstmSac, estimates: true };
    const TD3_BASELINE: AgentKind = AgentKind { algorithm: Algorithm::LstmTd3, estimates: false };

    #[test]
    fn runs_are_named_after_what_they_train() {
        assert_eq!(run_name(Waters::Coastal, SAC, 4, 1), "coastal-lstm-sac-seed-1");
        assert_eq!(
            run_name(Waters::Stochastic, TD3_BASELINE, 7, 2),
            "open-water-stochastic-lstm-td3-h7-baseline-seed-2"
        );
    }

    #[test]
    fn a_curve_tells_what_was_run() {
        let curve = run(Waters::Periodic, TD3_BASELINE, 10, 3, -20.0, 500);
        let facts = &curve.run;
        assert_eq!((facts.waters, facts.agent, facts.history_len), (Waters::Periodic, TD3_BASELINE, 10));
        assert_eq!((facts.seed, facts.steps, curve.points.len()), (3, 500, 5));
        assert_eq!(facts.name, "open-water-periodic-lstm-td3-h10-baseline-seed-3");
        assert!(curve.is_finished());
        let unfinished = Curve { run: RunFacts { steps: 600, ..facts.clone() }, ..curve.clone() };
        assert!(!unfinished.is_finished());
        assert_eq!(commits([&curve, &unfinished]), "commit 0123456789");
    }

    /// Two seeds: mean and interval by hand, `t` with one degree of freedom is 12.706.
    #[test]
    fn seeds_are_averaged_over_the_steps_that_all_reached() {
        let curves = [
            run(Waters::Coastal, SAC, 4, 1, -5.0, 300),
            run(Waters::Coastal, SAC, 4, 2, -5.0, 200),
            run(Waters::Coastal, TD3_BASELINE, 4, 1, -9.0, 300),
            run(Waters::Coastal, SAC, 7, 1, -9.0, 300),
        ];
        let group = Group::of(&curves, Waters::Coastal, SAC, 4);
        let points = group.points();
        assert_eq!(points.iter().map(|point| point.step).collect::<Vec<_>>(), [100, 200]);
        let Estimate { value, interval } = points[0].mean_return;
        assert!((value + 2.5).abs() < 1e-12);
        // Returns -3 and -2: standard deviation 1 / sqrt(2), over sqrt(2) seeds.
        assert!((interval.unwrap().high - (-2.5 + 12.706 * 0.5)).abs() < 1e-3);
        assert_eq!(group.description(), "SL-LSTM-SAC: 2 seeds, 200 steps");
        assert!(Group::of(&curves, Waters::Periodic, SAC, 4).points().is_empty());
    }

    #[test]
    fn one_run_counts_once_for_each_seed() {
        let curves = [run(Waters::Coastal, SAC, 4, 1, -5.0, 200), run(Waters::Coastal, SAC, 4, 1, -7.0, 400)];
        let group = Group::of(&curves, Waters::Coastal, SAC, 4);
        assert_eq!((group.curves.len(), group.curves[0].last_step()), (1, Some(400)));
    }

    #[test]
    fn files_that_are_something_else_are_named_with_what_is_wrong() {
        let settings = "steps = 10\nestimates = true\n[open_water]\nmotion = \"periodic\"\n[trainer]\nseed = 1\n\
                        evaluate_every = 5\n[trainer.agent]\nalgorithm = \"lstm-sac\"\nhistory_len = 4\n";
        let good = RunTexts {
            config: format!("env = \"coastal\"\n{settings}"),
            evaluations: "step,mean_return,sd_return,mean_decisions,episodes\n5,-1,,15,1\n".into(),
            origin: None,
        };
        let error = |texts: RunTexts| Curve::parse(Path::new("results/x"), &texts).unwrap_err().to_string();
        let curve = Curve::parse(Path::new("results/x"), &good).unwrap();
        assert_eq!((curve.points[0].sd_return, curve.run.origin), (None, None));
        for (env, expected) in [("env = \"lake\"\n", "\"lake\""), ("", "env")] {
            let text = error(RunTexts { config: format!("{env}{settings}"), ..good.clone() });
            assert!(text.contains("results/x/config.toml") && text.contains(expected), "{text}");
        }
        for (line, expected) in [("5,-2,,15,1\n", "step 5"), ("6,x,,15,1\n", "line: 3")] {
            let text = error(RunTexts { evaluations: good.evaluations.clone() + line, ..good.clone() });
            assert!(text.contains("evaluations.csv") && text.contains(expected), "{text}");
        }
        let text = error(RunTexts { origin: Some("commit = 3".into()), ..good });
        assert!(text.contains("origin.toml"), "{text}");
    }
}
