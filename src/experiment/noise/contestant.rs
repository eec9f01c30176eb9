//! Who takes part: trained agents on the environment's own observation, classical policies on what their
//! sensors show, both through one door.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::NoiseError;
use crate::env::coastal::{Coastal, CoastalConfig, EstimateSource};
use crate::policy::Policy;
use crate::rl::agent::Algorithm;

/// What a contestant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// It has learnt to steer.
    Agent,
    /// Someone wrote down how it steers.
    Classical,
}

/// What a contestant is told of the recorded vessel's future.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimates {
    /// Nothing.
    None,
    /// A forecast, by the forecaster of this number.
    Forecast(usize),
    /// What will truly happen: tells an error of the forecast from one of the policy.
    Truth,
}

impl Estimates {
    pub(super) fn source(self) -> EstimateSource {
        match self {
            Self::Truth => EstimateSource::Truth,
            Self::None | Self::Forecast(_) => EstimateSource::Forecast,
        }
    }

    /// As files write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Forecast(_) => "forecast",
            Self::Truth => "truth",
        }
    }
}

/// One that steers own ship through an episode after another.
pub trait Helm {
    /// An episode begins.
    fn begin(&mut self, seed: u64);

    /// The action for the present situation, of which the environment made `observation`.
    fn action(&mut self, env: &Coastal, observation: &[f32]) -> f32;
}

/// A classical policy at the helm.
impl Helm for Box<dyn Policy> {
    fn begin(&mut self, seed: u64) {
        self.reset(seed);
    }

    fn action(&mut self, env: &Coastal, _observation: &[f32]) -> f32 {
        // Nothing only before the first reset, and then nobody asks.
        env.ask(self.as_mut()).unwrap_or(0.0)
    }
}

type MakeHelm = dyn Fn() -> Box<dyn Helm> + Send + Sync;

/// One who takes part.
#[derive(Clone)]
pub struct Contestant {
    /// What tables call it.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// What it is told of the future.
    pub estimates: Estimates,
    /// How it learnt; nothing for a classical policy.
    pub algorithm: Option<Algorithm>,
    /// The encounters, and the observation it reads.
    pub coastal: CoastalConfig,
    make_helm: Arc<MakeHelm>,
}

impl fmt::Debug for Contestant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, kind, estimates, .. } = self;
        f.debug_struct("Contestant")
            .field("name", name)
            .field("kind", kind)
            .field("estimates", estimates)
            .finish()
    }
}

impl Contestant {
    /// A classical policy.
    #[must_use]
    pub fn classical(
        name: impl Into<String>,
        estimates: Estimates,
        coastal: &CoastalConfig,
        make: impl Fn() -> Box<dyn Policy> + Send + Sync + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            kind: Kind::Classical,
            estimates,
            algorithm: None,
            coastal: coastal.clone(),
            make_helm: Arc::new(move || Box::new(make())),
        }
    }

    /// A trained agent, which reads the observation of the `coastal` it was trained in.
    ///
    /// # Errors
    ///
    /// When the encounters that it was trained in are not those of `benchmark`.
    pub fn agent(
        name: impl Into<String>,
        (algorithm, estimates): (Algorithm, Estimates),
        (coastal, benchmark): (&CoastalConfig, &CoastalConfig),
        make: impl Fn() -> Box<dyn Helm> + Send + Sync + 'static,
    ) -> Result<Self, NoiseError> {
        let name = name.into();
        if let Some(key) = first_difference(coastal, benchmark) {
            return Err(NoiseError::OtherEpisodes { policy: name, key });
        }
        let make_helm = Arc::new(make);
        let algorithm = Some(algorithm);
        Ok(Self { name, kind: Kind::Agent, estimates, algorithm, coastal: coastal.clone(), make_helm })
    }

    /// The same with estimates from the true future, for diagnosis; nothing for one without estimates.
    #[must_use]
    pub fn with_true_future(&self) -> Option<Self> {
        let knows = matches!(self.estimates, Estimates::Forecast(_));
        let name = format!("{} (true future)", self.name);
        knows.then(|| Self { name, estimates: Estimates::Truth, ..self.clone() })
    }

    pub(super) fn helm(&self) -> Box<dyn Helm> {
        (self.make_helm)()
    }
}

/// The first key by which two environments do not have the same episodes. Scales of the observation and
/// what the benchmark sets itself make no difference to them.
fn first_difference(ours: &CoastalConfig, theirs: &CoastalConfig) -> Option<String> {
    let alike = CoastalConfig {
        scenario: theirs.scenario,
        estimates: theirs.estimates,
        noise_m: theirs.noise_m,
        speed_scale_mps: theirs.speed_scale_mps,
        cross_track_scale_m: theirs.cross_track_scale_m,
        distance_scale_m: theirs.distance_scale_m,
        dcpa_scale_m: theirs.dcpa_scale_m,
        tcpa_scale_s: theirs.tcpa_scale_s,
        ..ours.clone()
    };
    if alike == *theirs {
        return None;
    }
    let table = |config: &CoastalConfig| toml::Table::try_from(config).unwrap_or_default();
    let (ours, theirs) = (table(&alike), table(theirs));
    let differs = theirs.iter().find(|(key, value)| ours.get(*key) != Some(value));
    Some(differs.map_or_else(|| "a key".to_owned(), |(key, _)| format!("`{key}`")))
}
