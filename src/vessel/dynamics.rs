//! Which dynamics a steered vessel has, as a scenario or an environment chooses them.

use serde::{Deserialize, Serialize};

use super::mmg::Surroundings;
use super::{Kinematic, KinematicConfig, MmgConfig, MmgShip, Steered};
use crate::angle::Nautical;
use crate::geo::Position;

/// The kinds of dynamics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dynamics {
    /// Heading changes at once, speed is constant.
    #[default]
    Kinematic,
    /// The tanker KVLCC2 by the MMG standard method.
    Kvlcc2,
}

/// A kind of dynamics and the settings of each.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DynamicsConfig {
    /// Which of them is meant.
    pub dynamics: Dynamics,
    /// Settings of [`Dynamics::Kinematic`].
    pub kinematic: KinematicConfig,
    /// Settings of [`Dynamics::Kvlcc2`].
    pub kvlcc2: MmgConfig,
}

impl DynamicsConfig {
    /// A vessel under way in still water and air, on a straight course.
    #[must_use]
    pub fn launch(&self, position: Position, heading: Nautical, speed_mps: f64) -> Box<dyn Steered> {
        match self.dynamics {
            Dynamics::Kinematic => Box::new(Kinematic::new(self.kinematic, position, heading, speed_mps)),
            Dynamics::Kvlcc2 => {
                let still = Surroundings::default();
                Box::new(MmgShip::new(self.kvlcc2, still, position, heading, speed_mps))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_config_file_chooses_the_dynamics() {
        let config: DynamicsConfig =
            toml::from_str("dynamics = \"kvlcc2\"\nkvlcc2.max_turn_deg = 5.0").expect("a config");
        let ship = config.launch(Position::ORIGIN, Nautical::NORTH, 7.0);
        assert!((ship.max_turn_rad() - 5.0_f64.to_radians()).abs() < 1e-12);
        assert!(toml::from_str::<DynamicsConfig>("dynamics = \"submarine\"").is_err());
        let kinematic = DynamicsConfig::default().launch(Position::ORIGIN, Nautical::NORTH, 7.0);
        assert!((kinematic.max_turn_rad() - 2.4_f64.to_radians()).abs() < 1e-12);
    }
}
