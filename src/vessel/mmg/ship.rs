//! A ship under way: MMG dynamics under a heading autopilot and speed control.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::dynamics::{Actuators, Hydrodynamics, MmgMotion, Surroundings};
use super::parameters::{MmgParameters, ParameterSet};
use crate::angle::Nautical;
use crate::geo::{Displacement, Position, Velocity};
use crate::vessel::{Command, Steered, VesselState};

/// Gains of autopilot and speed control, free of dimensions so that they suit a ship of any size.
///
/// With `L` the ship's length, `D` its propeller's diameter and `U_0` its design speed, the ordered
/// rudder is `heading_gain * error - yaw_gain * r L / U_0`, and the ordered revolutions are those of
/// self-propulsion plus `speed_gain * (ordered speed - u) / D`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AutopilotConfig {
    /// Radians of rudder per radian of heading error.
    pub heading_gain: f64,
    /// Radians of rudder per radian of heading turned in the time the ship needs for its length.
    pub yaw_gain: f64,
    /// Revolutions per propeller diameter of missing way.
    pub speed_gain: f64,
    /// Largest revolutions over those of self-propulsion at the design speed.
    pub max_revolutions: f64,
}

impl Default for AutopilotConfig {
    fn default() -> Self {
        Self { heading_gain: 2.0, yaw_gain: 3.0, speed_gain: 1.0, max_revolutions: 1.1 }
    }
}

/// Settings of a ship with MMG dynamics.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MmgConfig {
    /// Dimensions and coefficients.
    pub parameters: MmgParameters,
    /// Autopilot and speed control.
    pub autopilot: AutopilotConfig,
    /// Steps of the integration in the time that the ship needs for its length at its design speed, at
    /// least; a time step is divided evenly. For KVLCC2 at full size 80 come to half a second.
    pub steps_per_length: f64,
    /// The largest change of the ordered heading in one decision, in degrees.
    pub max_turn_deg: f64,
}

impl Default for MmgConfig {
    fn default() -> Self {
        Self {
            parameters: ParameterSet::default().parameters(),
            autopilot: AutopilotConfig::default(),
            steps_per_length: 80.0,
            max_turn_deg: 10.0,
        }
    }
}

/// A ship with MMG dynamics. It takes the same orders as every steered vessel: its autopilot turns
/// it to the ordered heading and its propeller keeps the ordered speed through the water.
#[derive(Debug, Clone)]
pub struct MmgShip {
    ship: Arc<Hydrodynamics>,
    config: MmgConfig,
    surroundings: Surroundings,
    motion: MmgMotion,
    actuators: Actuators,
    ordered_heading: Nautical,
    ordered_speed_mps: f64,
}

impl MmgShip {
    /// On a straight course, rudder midships, at the revolutions of its speed through the water.
    #[must_use]
    pub fn new(
        config: MmgConfig,
        surroundings: Surroundings,
        position: Position,
        heading: Nautical,
        speed_mps: f64,
    ) -> Self {
        let ship = Hydrodynamics::new(config.parameters);
        Self {
            motion: MmgMotion {
                north_m: position.north_m,
                east_m: position.east_m,
                heading_rad: heading.radians(),
                surge_mps: speed_mps,
                ..MmgMotion::default()
            },
            actuators: Actuators {
                rudder_rad: 0.0,
                revolutions_per_s: ship.self_propulsion_per_s(speed_mps),
            },
            ship: Arc::new(ship),
            config,
            surroundings,
            ordered_heading: heading,
            ordered_speed_mps: speed_mps,
        }
    }

    /// Motion through the water and heading.
    #[must_use]
    pub fn motion(&self) -> &MmgMotion {
        &self.motion
    }

    /// Rudder and propeller.
    #[must_use]
    pub fn actuators(&self) -> &Actuators {
        &self.actuators
    }

    fn heading(&self) -> Nautical {
        Nautical::from_radians(self.motion.heading_rad)
    }

    fn ordered_rudder_rad(&self) -> f64 {
        let AutopilotConfig { heading_gain, yaw_gain, .. } = self.config.autopilot;
        let yaw_rate = self.motion.yaw_rate_rad_per_s * self.config.parameters.time_unit_s();
        heading_gain * self.ordered_heading.turn_from(self.heading()) - yaw_gain * yaw_rate
    }

    fn ordered_revolutions_per_s(&self) -> f64 {
        let AutopilotConfig { speed_gain, max_revolutions, .. } = self.config.autopilot;
        let MmgParameters { design_speed_mps, propeller_diameter_m, .. } = self.config.parameters;
        let most = max_revolutions * self.ship.self_propulsion_per_s(design_speed_mps);
        let missing_mps = self.ordered_speed_mps - self.motion.surge_mps;
        (self.ship.self_propulsion_per_s(self.ordered_speed_mps)
            + speed_gain * missing_mps / propeller_diameter_m)
            .clamp(0.0, most)
    }
}

impl Steered for MmgShip {
    fn state(&self) -> VesselState {
        let heading = self.heading();
        let through_water = Displacement::towards(heading, self.motion.surge_mps)
            + Displacement::towards(heading.turned(std::f64::consts::FRAC_PI_2), self.motion.sway_mps);
        let velocity = Velocity { north_mps: through_water.north_m, east_mps: through_water.east_m };
        VesselState {
            position: Position { north_m: self.motion.north_m, east_m: self.motion.east_m },
            velocity: velocity + self.surroundings.current,
            heading,
        }
    }

    fn ordered_heading(&self) -> Nautical {
        self.ordered_heading
    }

    fn max_turn_rad(&self) -> f64 {
        self.config.max_turn_deg.to_radians()
    }

    fn order(&mut self, command: Command) {
        let limit_rad = self.max_turn_rad();
        self.ordered_heading = self.ordered_heading.turned(command.turn_rad.clamp(-limit_rad, limit_rad));
        self.ordered_speed_mps = command.speed_mps.unwrap_or(self.ordered_speed_mps).max(0.0);
    }

    fn advance(&mut self, dt_s: f64) {
        let lengths = dt_s / self.config.parameters.time_unit_s();
        let substeps = (lengths * self.config.steps_per_length).ceil().max(1.0);
        let substep_s = dt_s / substeps;
        for _ in 0..substeps as usize {
            self.actuators.revolutions_per_s = self.ordered_revolutions_per_s();
            (self.motion, self.actuators) = self.ship.advance(
                &self.motion,
                &self.actuators,
                self.ordered_rudder_rad(),
                &self.surroundings,
                substep_s,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vessel::mmg::dynamics::Wind;

    const STEPS_PER_LENGTH: f64 = 80.0;

    fn under_way(surroundings: Surroundings, steps_per_length: f64) -> MmgShip {
        let config = MmgConfig { steps_per_length, max_turn_deg: 60.0, ..MmgConfig::default() };
        MmgShip::new(config, surroundings, Position::ORIGIN, Nautical::NORTH, 7.0)
    }

    fn turned(steps_per_length: f64, turn_deg: f64, steps: usize) -> MmgShip {
        let mut ship = under_way(Surroundings::default(), steps_per_length);
        ship.order(Command { turn_rad: turn_deg.to_radians(), speed_mps: None });
        for _ in 0..steps {
            ship.advance(5.0);
        }
        ship
    }

    #[test]
    fn the_autopilot_comes_to_the_ordered_heading_and_stays() {
        for turn_deg in [20.0, -50.0] {
            let mut ship = turned(STEPS_PER_LENGTH, turn_deg, 1);
            let mut furthest_deg = 0.0_f64;
            for _ in 0..240 {
                ship.advance(5.0);
                let heading_deg = ship.motion().heading_rad.to_degrees() / turn_deg.signum();
                furthest_deg = furthest_deg.max(heading_deg);
            }
            let error_deg = ship.state().heading.turn_from(ship.ordered_heading()).to_degrees();
            assert!(error_deg.abs() < 0.5, "{error_deg} after {turn_deg}");
            assert!(furthest_deg < 1.1 * turn_deg.abs(), "overshoot to {furthest_deg}");
        }
    }

    #[test]
    fn the_ordered_speed_is_reached_and_kept() {
        let mut ship = under_way(Surroundings::default(), STEPS_PER_LENGTH);
        ship.order(Command { turn_rad: 0.0, speed_mps: Some(4.0) });
        for _ in 0..1000 {
            ship.advance(5.0);
        }
        assert!((ship.state().velocity.speed_mps() - 4.0).abs() < 0.04, "{:?}", ship.state());
    }

    /// What the default number of steps was chosen by. A hard turn and its recovery, five minutes under
    /// the autopilot, are compared with steps fifty times smaller: at the default they end within a metre, with
    /// a quarter of its steps more than twice as far off.
    #[test]
    fn the_substep_has_converged() {
        let fine = turned(50.0 * STEPS_PER_LENGTH, 60.0, 60).state();
        let off = |steps_per_length: f64| {
            let state = turned(steps_per_length, 60.0, 60).state();
            let turn_rad = state.heading.turn_from(fine.heading).abs();
            (state.position.distance_m(fine.position), turn_rad.to_degrees())
        };
        assert_eq!(MmgConfig::default().steps_per_length, STEPS_PER_LENGTH);
        let errors = [4.0, 2.0, 1.0, 0.5, 0.25].map(|finer| {
            let error = off(finer * STEPS_PER_LENGTH);
            // The table of docs/physics.md.
            println!("| {} | {:.3} | {:.4} |", finer * STEPS_PER_LENGTH, error.0, error.1);
            error
        });
        assert!(errors.windows(2).all(|pair| pair[0].0 < pair[1].0), "{errors:?}");
        let (error_m, error_deg) = errors[2];
        assert!(error_m < 1.0 && error_deg < 0.05, "{errors:?}");
        assert!(errors[4].0 > 2.0 * error_m, "{errors:?}");
    }

    #[test]
    fn current_carries_the_ship_along() {
        let current = Velocity { north_mps: 0.0, east_mps: 1.0 };
        let mut ship = under_way(Surroundings { current, wind: None }, STEPS_PER_LENGTH);
        for _ in 0..20 {
            ship.advance(5.0);
        }
        let state = ship.state();
        assert!((state.position.east_m - 100.0).abs() < 1e-6);
        assert!((state.velocity.east_mps - 1.0).abs() < 1e-9);
        assert_eq!(state.heading, Nautical::NORTH);
    }

    #[test]
    fn wind_from_the_beam_sets_the_ship_to_leeward() {
        let wind = Some(Wind { from: Nautical::from_degrees(270.0), speed_mps: 15.0 });
        let mut ship = under_way(Surroundings { wind, ..Surroundings::default() }, STEPS_PER_LENGTH);
        for _ in 0..120 {
            ship.advance(5.0);
        }
        let off_deg = ship.state().heading.turn_from(Nautical::NORTH).to_degrees();
        // Some sway to leeward, against which the autopilot keeps the bow within a few degrees.
        assert!(ship.motion().sway_mps > 0.01, "{:?}", ship.motion());
        assert!(off_deg.abs() < 5.0, "{off_deg}");
    }

    /// Froude's law: a ship a ninth as long makes the same track over its length, in a third of the time.
    #[test]
    fn a_scaled_ship_makes_the_same_track_over_its_length() {
        let run = |scale: f64| {
            let parameters = MmgParameters::default().scaled_to(320.0 * scale);
            let config = MmgConfig { parameters, max_turn_deg: 60.0, ..MmgConfig::default() };
            let wind = Wind { from: Nautical::from_degrees(300.0), speed_mps: 12.0 * scale.sqrt() };
            let current = Velocity { north_mps: 0.0, east_mps: scale.sqrt() };
            let surroundings = Surroundings { current, wind: Some(wind) };
            let speed_mps = 7.0 * scale.sqrt();
            let mut ship = MmgShip::new(config, surroundings, Position::ORIGIN, Nautical::NORTH, speed_mps);
            ship.order(Command { turn_rad: 0.9, speed_mps: Some(0.8 * speed_mps) });
            for _ in 0..60 {
                ship.advance(6.0 * scale.sqrt());
            }
            ship
        };
        let (full, small) = (run(1.0), run(1.0 / 9.0));
        let (full_end, small_end) = (full.state(), small.state());
        assert!(full_end.position.distance_m(Position::ORIGIN) > 1000.0);
        assert!((full_end.position.north_m / 9.0 - small_end.position.north_m).abs() < 1e-6);
        assert!((full_end.position.east_m / 9.0 - small_end.position.east_m).abs() < 1e-6);
        assert!(full_end.heading.turn_from(small_end.heading).abs() < 1e-9);
        assert!((full.motion().surge_mps / 3.0 - small.motion().surge_mps).abs() < 1e-9);
    }
}
