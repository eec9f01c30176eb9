//! Own ship's sensors as a [`Policy`] reads them, so that any policy can sail the environment's episodes.

use super::{Coastal, Episode};
use crate::geo::Position;
use crate::policy::{OwnShip, Policy, Route, Situation, TargetShip};

impl Coastal {
    /// The action with which `policy` answers the present situation: its turn over the greatest one.
    /// Nothing before the first reset.
    ///
    /// Positions and histories are as sensed; the forecast is the one behind the estimates, where the
    /// environment makes them. Own ship's speed is not for the policy to choose here.
    pub fn ask(&self, policy: &mut dyn Policy) -> Option<f32> {
        let episode = self.episode.as_ref()?;
        let step = episode.step(self.steps_per_decision());
        let histories: Vec<Vec<Position>> =
            (0..self.states.len()).map(|vessel| self.sensed_history(episode, vessel, step)).collect();
        let targets: Vec<TargetShip<'_>> =
            (1..self.states.len()).map(|vessel| self.target(vessel, step, &histories[vessel])).collect();
        let max_turn_rad = episode.own.max_turn_rad();
        let situation = Situation {
            time_s: step as f64 * self.traffic.dt_s,
            dt_s: self.traffic.dt_s,
            decision_s: self.config.head_on.decision_interval_s,
            own: self.own_ship(episode, &histories[0]),
            route: &Route::straight(episode.opening.path.position, episode.opening.path.course),
            targets: &targets,
        };
        let turn_rad = policy.decide(&situation).turn_rad;
        Some((turn_rad / max_turn_rad) as f32)
    }

    fn own_ship<'a>(&self, episode: &Episode, history: &'a [Position]) -> OwnShip<'a> {
        let state = self.states[0];
        OwnShip {
            position: history.last().copied().unwrap_or(state.position),
            velocity: state.velocity,
            heading: state.heading,
            ordered_heading: episode.own.ordered_heading(),
            max_turn_rad: episode.own.max_turn_rad(),
            planned_speed_mps: self.config.head_on.own_speed_mps,
            max_speed_change_mps: 0.0,
            history,
        }
    }

    fn target<'a>(&'a self, vessel: usize, step: i64, history: &'a [Position]) -> TargetShip<'a> {
        let state = self.states[vessel];
        TargetShip {
            position: history.last().copied().unwrap_or(state.position),
            velocity: state.velocity,
            history,
            forecast: (vessel == 1).then(|| self.path_ahead(step)).flatten(),
            collision_distance_m: self.config.collision_distance_m,
        }
    }

    /// What is left at a time step of the last forecast of the recorded vessel.
    pub(super) fn path_ahead(&self, step: i64) -> Option<&[Position]> {
        let (forecast_step, path) = self.ahead.as_ref()?;
        path.get((step - forecast_step) as usize..).filter(|left| !left.is_empty())
    }
}
