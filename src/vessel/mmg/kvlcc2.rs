//! KVLCC2 at any length, as scenarios and environments choose it.

use serde::{Deserialize, Serialize};

use super::parameters::{MmgParameters, ParameterSet};
use super::ship::{AutopilotConfig, MmgConfig};
use crate::config::{Fault, check_bounds};

/// Which KVLCC2: its length, its engine and its rudder.
///
/// A length other than 320 m scales the ship after Froude's law ([`MmgParameters::scaled_to`]). That
/// brings its design speed down with the root of the length; a smaller ship that is to go faster than
/// that needs a stronger engine, and is told so by [`Self::service_speed_mps`]. Then its Froude number
/// is beyond that of the model tests, and its resistance, which grows with the square of the speed
/// here, is too small.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Kvlcc2Config {
    /// Length between perpendiculars, in metres.
    pub length_m: f64,
    /// Which values go with the published coefficients.
    pub parameters: ParameterSet,
    /// Speed that the engine is made for, in metres per second; where it is not given, 15.5 knots scaled
    /// with the root of the length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub service_speed_mps: Option<f64>,
    /// Largest rudder angle, in degrees.
    pub max_rudder_deg: f64,
    /// Rate at which the rudder moves, in degrees per second; where it is not given, 1.76 scaled with the
    /// root of the length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rudder_rate_deg_per_s: Option<f64>,
    /// Autopilot and speed control.
    pub autopilot: AutopilotConfig,
    /// Steps of the integration, see [`MmgConfig::steps_per_length`].
    pub steps_per_length: f64,
}

impl Default for Kvlcc2Config {
    fn default() -> Self {
        let MmgParameters { length_m, max_rudder_deg, .. } = MmgParameters::default();
        let MmgConfig { autopilot, steps_per_length, .. } = MmgConfig::default();
        Self {
            length_m,
            parameters: ParameterSet::default(),
            service_speed_mps: None,
            max_rudder_deg,
            rudder_rate_deg_per_s: None,
            autopilot,
            steps_per_length,
        }
    }
}

impl Kvlcc2Config {
    /// Dimensions and coefficients.
    #[must_use]
    pub fn ship(&self) -> MmgParameters {
        let scaled = self.parameters.parameters().scaled_to(self.length_m);
        MmgParameters {
            design_speed_mps: self.service_speed_mps.unwrap_or(scaled.design_speed_mps),
            max_rudder_deg: self.max_rudder_deg,
            rudder_rate_deg_per_s: self.rudder_rate_deg_per_s.unwrap_or(scaled.rudder_rate_deg_per_s),
            ..scaled
        }
    }

    /// The settings of the ship with its autopilot; each decision turns the ordered heading by
    /// `max_turn_deg` at most.
    #[must_use]
    pub fn mmg(&self, max_turn_deg: f64) -> MmgConfig {
        MmgConfig {
            parameters: self.ship(),
            autopilot: self.autopilot,
            steps_per_length: self.steps_per_length,
            max_turn_deg,
        }
    }

    /// The greatest speed through the water that the engine keeps, in metres per second. Revolutions at
    /// self-propulsion are in proportion to speed.
    #[must_use]
    pub fn top_speed_mps(&self) -> f64 {
        self.ship().design_speed_mps * self.autopilot.max_revolutions
    }

    /// Checks every number, and that the engine keeps a speed through the water.
    ///
    /// # Errors
    /// Names the key at fault and says what to write.
    pub fn check(&self, speed_mps: f64) -> Result<(), Fault> {
        let design = self.ship();
        let AutopilotConfig { heading_gain, yaw_gain, speed_gain, max_revolutions } = self.autopilot;
        check_bounds([
            ("length_m", self.length_m, [1.0, 600.0]),
            ("service_speed_mps", design.design_speed_mps, [0.1, 35.0]),
            ("max_rudder_deg", self.max_rudder_deg, [1.0, 45.0]),
            ("rudder_rate_deg_per_s", design.rudder_rate_deg_per_s, [0.1, 100.0]),
            ("autopilot.heading_gain", heading_gain, [0.0, 100.0]),
            ("autopilot.yaw_gain", yaw_gain, [0.0, 100.0]),
            ("autopilot.speed_gain", speed_gain, [0.0, 100.0]),
            ("autopilot.max_revolutions", max_revolutions, [0.1, 10.0]),
            ("steps_per_length", self.steps_per_length, [10.0, 10_000.0]),
        ])?;
        let top_mps = self.top_speed_mps();
        // A speed that was converted from knots may be off by its last digits.
        if speed_mps > top_mps * (1.0 + 1e-9) {
            return Err(Fault::new(
                "service_speed_mps",
                format!(
                    "the engine of KVLCC2 at a length of {:.0} m keeps {top_mps:.1} m/s, less than the \
                     {speed_mps:.1} m/s wanted",
                    self.length_m
                ),
                format!("write a lower speed, a greater length_m, or service_speed_mps = {speed_mps:.1}"),
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_scales_the_ship_and_its_engine() {
        assert_eq!(Kvlcc2Config::default().ship(), MmgParameters::default());
        let coaster = Kvlcc2Config { length_m: 80.0, ..Kvlcc2Config::default() };
        assert!((coaster.ship().beam_m - 14.5).abs() < 1e-12);
        assert!((coaster.ship().displacement_m3 - 312_600.0 / 64.0).abs() < 1e-9);
        assert!((coaster.ship().rudder_rate_deg_per_s - 3.52).abs() < 1e-12);
        assert!((coaster.top_speed_mps() - 1.1 * 7.75 * crate::geo::MPS_PER_KNOT).abs() < 1e-9);
        assert_eq!(coaster.check(4.3), Ok(()));
        let error = coaster.check(8.0).unwrap_err();
        assert_eq!(error.key, "service_speed_mps");
        assert!(error.to_string().contains("at a length of 80 m keeps 4.4 m/s"), "{error}");
        assert_eq!(Kvlcc2Config { service_speed_mps: Some(8.0), ..coaster }.check(8.0), Ok(()));
    }

    #[test]
    fn numbers_that_make_no_ship_are_refused() {
        for config in [
            Kvlcc2Config { length_m: f64::NAN, ..Kvlcc2Config::default() },
            Kvlcc2Config { length_m: 0.0, ..Kvlcc2Config::default() },
            Kvlcc2Config { service_speed_mps: Some(0.0), ..Kvlcc2Config::default() },
            Kvlcc2Config { max_rudder_deg: 90.0, ..Kvlcc2Config::default() },
            Kvlcc2Config { steps_per_length: 0.0, ..Kvlcc2Config::default() },
        ] {
            assert!(config.check(5.0).is_err(), "{config:?}");
        }
    }
}
