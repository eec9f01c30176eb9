//! Forecasts for the policy: where own ship expects the target ships to go.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::model::Scenario;
use crate::config::Fault;
use crate::forecast::{Forecaster, Forecasts, LinearForecaster, LstmForecaster, Model};
use crate::geo::{LocalPlane, Position};

/// The word for the linear forecaster, in scenario files and on the command line.
const LINEAR: &str = "linear";

/// What forecasts the target ships.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ForecasterChoice {
    /// Straight on at the least-squares velocity of the scenario's history.
    Linear,
    /// A trained model, from its weights.
    Model(PathBuf),
}

impl ForecasterChoice {
    /// From a word of the command line or a scenario file: `linear`, or a file of weights whose path starts
    /// from `directory`.
    #[must_use]
    pub fn of(word: &str, directory: &Path) -> Self {
        if word == LINEAR { Self::Linear } else { Self::Model(directory.join(word)) }
    }
}

impl fmt::Display for ForecasterChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Linear => f.write_str(LINEAR),
            Self::Model(file) => write!(f, "{}", file.display()),
        }
    }
}

/// A forecaster that fits its scenario, ready for any number of runs.
#[derive(Debug, Clone)]
pub struct Foresight {
    model: ReadyModel,
    horizon_steps: usize,
}

#[derive(Debug, Clone)]
enum ReadyModel {
    Linear { history_len: usize },
    Lstm(Arc<Model>),
}

impl Scenario {
    /// Reads what forecasts the targets and checks that it fits the plane and the time step.
    pub(super) fn foresight(
        &self,
        choice: &ForecasterChoice,
        plane: Option<LocalPlane>,
    ) -> Result<Foresight, Fault> {
        let model = match choice {
            ForecasterChoice::Linear => {
                ReadyModel::Linear { history_len: (self.history_s / self.dt_s).ceil() as usize }
            }
            ForecasterChoice::Model(file) => ReadyModel::Lstm(Arc::new(self.model(file, plane)?)),
        };
        let horizon_steps =
            (self.forecast_horizon_s / self.dt_s).ceil().clamp(1.0, self.limits.steps_max as f64);
        Ok(Foresight { model, horizon_steps: horizon_steps as usize })
    }

    fn model(&self, file: &Path, plane: Option<LocalPlane>) -> Result<Model, Fault> {
        let fault = |message: String, remedy: &str| Fault::new("forecaster", message, remedy);
        let model = Model::open(file).map_err(|error| {
            fault(error.to_string(), "write \"linear\" or a file of a trained forecaster")
        })?;
        let dt_s = model.config.dt_s();
        if dt_s != self.dt_s {
            return Err(fault(
                format!(
                    "{} forecasts in steps of {dt_s} s, the scenario has {} s",
                    file.display(),
                    self.dt_s
                ),
                "take one time step for both",
            ));
        }
        if let Some(origin) = model.origin
            && plane != Some(LocalPlane::at(origin))
        {
            return Err(fault(
                format!(
                    "{} was trained in the local plane of {:.4}, {:.4} and knows no other",
                    file.display(),
                    origin.latitude_deg,
                    origin.longitude_deg
                ),
                "take a model of the area that the recorded targets come from, or write \"linear\"",
            ));
        }
        Ok(model)
    }
}

impl Foresight {
    /// For one run; nothing is forecast yet.
    pub(super) fn begin(&self) -> TargetForecasts {
        let forecaster: Box<dyn Forecaster> = match &self.model {
            ReadyModel::Linear { history_len } => Box::new(LinearForecaster::over(*history_len)),
            ReadyModel::Lstm(model) => Box::new(LstmForecaster::new(Model::clone(model), 1)),
        };
        TargetForecasts {
            forecaster,
            horizon_steps: self.horizon_steps,
            made_at: 0,
            rows: Vec::new(),
            forecasts: Forecasts::new(),
        }
    }
}

/// The latest forecast of every target of a run.
pub(super) struct TargetForecasts {
    forecaster: Box<dyn Forecaster>,
    horizon_steps: usize,
    made_at: i64,
    /// Row of the batch for each target; nothing for one that too little is known of.
    rows: Vec<Option<usize>>,
    forecasts: Forecasts,
}

impl TargetForecasts {
    /// Forecasts all targets anew from what was observed up to `step`, the present one.
    pub fn update(&mut self, step: i64, observed: &[Vec<Position>]) {
        let window = self.forecaster.history_len();
        let is_known = |history: &[Position]| {
            let recent = &history[history.len().saturating_sub(window)..];
            recent.iter().filter(|position| position.is_finite()).count() >= 2
        };
        self.rows.clear();
        let mut histories: Vec<&[Position]> = Vec::with_capacity(observed.len());
        for history in observed {
            let known = is_known(history);
            self.rows.push(known.then_some(histories.len()));
            if known {
                histories.push(history);
            }
        }
        self.made_at = step;
        // All of them have a velocity, which is all that a forecaster insists on.
        if self.forecaster.forecast(&histories, self.horizon_steps, &mut self.forecasts).is_err() {
            self.rows.fill(None);
        }
    }

    /// What is left of a target's forecast at `step`, the next position first.
    pub fn path(&self, target: usize, step: i64) -> Option<&[Position]> {
        let path = self.forecasts.path((*self.rows.get(target)?)?);
        path.get(usize::try_from(step - self.made_at).ok()?..)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;
    use crate::episode::Episode;
    use crate::policy::HoldCourse;
    use crate::scenario::{OwnShip, Placement, Point, TargetMotion};

    fn weaving() -> Scenario {
        let course = Nautical::from_degrees(200.0);
        let placement = Placement::At { point: Point::local(6000.0, 500.0), course, speed_mps: 6.0 };
        let motion = TargetMotion::Periodic(placement, crate::vessel::PeriodicConfig::default());
        Scenario::new("weaving", OwnShip::heading(0.0)).target("ship", motion)
    }

    fn run(scenario: &Scenario) -> Episode {
        scenario.set_up().unwrap().run_under(&mut HoldCourse)
    }

    #[test]
    fn a_linear_forecast_goes_straight_on_from_what_was_observed() {
        let episode = run(&weaving().forecaster(ForecasterChoice::Linear));
        let path = &episode.steps[4].vessels[1].ahead;
        assert_eq!(path.len(), 200);
        let step = path[1] - path[0];
        // The weave averages out over the history: 6 m/s for 5 s, on a course of 200 degrees.
        assert!((step.length_m() - 30.0).abs() < 3.0, "{}", step.length_m());
        assert!((step.bearing().degrees() - 200.0).abs() < 5.0);
        assert!(path.windows(2).all(|pair| ((pair[1] - pair[0]) + -step).length_m() < 1e-6));
        assert!(episode.steps.iter().all(|step| step.vessels[0].ahead.is_empty()));
        assert!(run(&weaving()).steps.iter().all(|step| step.vessels[1].ahead.is_empty()));
    }

    #[test]
    fn between_decisions_the_last_forecast_is_used_up() {
        let episode = run(&weaving().forecaster(ForecasterChoice::Linear));
        let ahead = |step: usize| &episode.steps[step].vessels[1].ahead;
        assert_eq!(ahead(6)[..], ahead(4)[2..]);
        assert_ne!(ahead(8)[..], ahead(4)[4..]);
    }

    #[test]
    fn a_trained_model_serves_its_own_time_step_and_no_other() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/open-water-periodic.safetensors");
        let choice = ForecasterChoice::of("open-water-periodic.safetensors", file.parent().unwrap());
        assert_eq!(choice, ForecasterChoice::Model(file.clone()));
        let forecast = |choice| run(&weaving().forecaster(choice)).steps[0].vessels[1].ahead.clone();
        let (learned, linear) = (forecast(choice.clone()), forecast(ForecasterChoice::Linear));
        // The model weaves on where the line does not.
        let off_chord_m = |path: &[Position]| {
            let chord = (path[99] - path[0]).bearing();
            path[..100].iter().map(|place| (*place - path[0]).starboard_of_m(chord).abs()).fold(0.0, f64::max)
        };
        assert!(off_chord_m(&learned) > 30.0 && off_chord_m(&linear) < 1e-6, "{}", off_chord_m(&learned));

        let coarse = Scenario { dt_s: 10.0, ..weaving().forecaster(choice) };
        let fault = coarse.set_up().unwrap_err();
        assert!(fault.key == "forecaster" && fault.message.ends_with("steps of 5 s, the scenario has 10 s"));
    }

    #[test]
    fn a_model_of_another_area_and_a_missing_one_are_refused() {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("models");
        let refused = |word: &str| {
            let scenario = weaving().forecaster(ForecasterChoice::of(word, &models));
            scenario.set_up().unwrap_err()
        };
        let elsewhere = refused("coastal-ny-lower-bay.safetensors");
        assert!(elsewhere.message.contains("and knows no other"), "{elsewhere:?}");
        assert!(refused("no-such.safetensors").message.contains("no-such.safetensors"));
    }
}
