//! Episodes as the rest of searoom records them, to be shown and replayed.

use super::{Coastal, Episode};
use crate::episode::{self, PairStep, VesselInfo, VesselRole, VesselStep};
use crate::scenario::encounter_starts::HeadOnKind;

pub(super) use crate::episode::Step;

impl Coastal {
    /// From the next reset on, keeps every time step for [`Self::record`].
    pub fn keep_steps(&mut self) {
        self.kept_steps = Some(Vec::new());
    }

    pub(super) fn keep_step(&mut self, episode: &Episode, step: i64) {
        let Some(mut steps) = self.kept_steps.take() else { return };
        let vessels = self.states.iter().enumerate().map(|(vessel, state)| VesselStep {
            position: state.position,
            velocity: state.velocity,
            heading: state.heading,
            observed: (self.config.noise_m > 0.0).then(|| self.sensed(episode, vessel, step, state.position)),
            ahead: Vec::new(),
        });
        let pairs = self.world.reports().iter().map(PairStep::from).collect();
        steps.push(Step { vessels: vessels.collect(), pairs });
        self.kept_steps = Some(steps);
        self.keep_path_ahead(step);
    }

    /// Writes the forecast in force into the step kept last: a decision makes a new one.
    pub(super) fn keep_path_ahead(&mut self, step: i64) {
        let Some(mut steps) = self.kept_steps.take() else { return };
        if let Some(last) = steps.last_mut() {
            last.vessels[1].ahead = self.path_ahead(step).unwrap_or_default().to_vec();
        }
        self.kept_steps = Some(steps);
    }

    /// The episode so far, under the name of whoever steers. Nothing where its steps were not kept.
    #[must_use]
    pub fn record(&self, policy: &str) -> Option<episode::Episode> {
        let (episode, steps) = self.episode.as_ref().zip(self.kept_steps.as_ref())?;
        let own = VesselInfo::new("own ship", VesselRole::Own, "kinematic", &self.body);
        let target = |name: &str, motion| VesselInfo::new(name, VesselRole::Target, motion, &self.body);
        let recorded = target(&format!("MMSI {}", episode.opening.start.mmsi), "recorded");
        let linear = (1..=episode.opening.linear.len()).map(|k| target(&format!("traffic {k}"), "linear"));
        let description = match episode.opening.kind {
            HeadOnKind::BeforeCurve => {
                "Head-on with a recorded vessel that is about to turn to port and clear."
            }
            HeadOnKind::StraightOn => "Head-on with a recorded vessel that goes straight on.",
        };
        Some(episode::Episode {
            scenario: match episode.opening.kind {
                HeadOnKind::BeforeCurve => "Before a curve".to_owned(),
                HeadOnKind::StraightOn => "Straight on".to_owned(),
            },
            description: description.to_owned(),
            seed: episode.seed,
            policy: policy.to_owned(),
            dt_s: self.traffic.dt_s,
            origin: None,
            vessels: [own, recorded].into_iter().chain(linear).collect(),
            steps: steps.clone(),
        })
    }
}
