//! The kinematic own ship of the coastal environment: heading changes at once, speed is constant.
//!
//! Paper, section "Reinforcement learning environment" of the maritime part: the action is a heading
//! change of at most 2.4 degrees per decision.

use serde::{Deserialize, Serialize};

use super::{Command, Steered, VesselState};
use crate::angle::Nautical;
use crate::geo::Position;

/// Limits of the kinematic vessel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KinematicConfig {
    /// The largest heading change in one decision, in degrees.
    pub max_turn_deg: f64,
}

impl Default for KinematicConfig {
    fn default() -> Self {
        Self { max_turn_deg: 2.4 }
    }
}

/// A vessel that goes where its bow points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematic {
    position: Position,
    heading: Nautical,
    speed_mps: f64,
    max_turn_rad: f64,
}

impl Kinematic {
    /// From where it starts, its heading and its speed.
    #[must_use]
    pub fn new(config: KinematicConfig, position: Position, heading: Nautical, speed_mps: f64) -> Self {
        Self { position, heading, speed_mps, max_turn_rad: config.max_turn_deg.to_radians() }
    }
}

impl Steered for Kinematic {
    fn state(&self) -> VesselState {
        VesselState::on_course(self.position, self.heading, self.speed_mps)
    }

    fn ordered_heading(&self) -> Nautical {
        self.heading
    }

    fn max_turn_rad(&self) -> f64 {
        self.max_turn_rad
    }

    fn order(&mut self, command: Command) {
        let turn_rad = command.turn_rad.clamp(-self.max_turn_rad, self.max_turn_rad);
        self.heading = self.heading.turned(turn_rad);
        self.speed_mps = command.speed_mps.unwrap_or(self.speed_mps).max(0.0);
    }

    fn advance(&mut self, dt_s: f64) {
        self.position += self.state().velocity.for_seconds(dt_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_clipped_to_the_limit_and_obeyed_at_once() {
        let mut ship = Kinematic::new(KinematicConfig::default(), Position::ORIGIN, Nautical::NORTH, 8.0);
        ship.order(Command { turn_rad: 1.0, speed_mps: None });
        ship.advance(5.0);
        assert!((ship.state().heading.degrees() - 2.4).abs() < 1e-9);
        assert!((ship.state().position.east_m - 40.0 * 2.4_f64.to_radians().sin()).abs() < 1e-9);
        ship.order(Command { turn_rad: -0.01, speed_mps: Some(2.0) });
        assert!((ship.ordered_heading().radians() - (2.4_f64.to_radians() - 0.01)).abs() < 1e-12);
        assert!((ship.state().velocity.speed_mps() - 2.0).abs() < 1e-12);
    }
}
