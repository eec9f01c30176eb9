//! Which dynamics a steered vessel has, as a scenario or an environment chooses them.

use serde::{Deserialize, Serialize};

use super::mmg::Surroundings;
use super::{Kinematic, KinematicConfig, Kvlcc2Config, MmgShip, Steered, VesselState};
use crate::geo::{Position, Velocity};

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

impl Dynamics {
    /// The words of scenario files.
    pub const WORDS: [(&'static str, Self); 2] = [("kinematic", Self::Kinematic), ("kvlcc2", Self::Kvlcc2)];

    /// The word for this kind.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Kinematic => "kinematic",
            Self::Kvlcc2 => "kvlcc2",
        }
    }
}

/// A kind of dynamics with its settings.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DynamicsConfig {
    /// Which of them is meant.
    pub dynamics: Dynamics,
    /// Settings of [`Dynamics::Kvlcc2`].
    pub kvlcc2: Kvlcc2Config,
}

/// A vessel about to be steered: where it is and how it moves over ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Launch {
    /// Midship.
    pub position: Position,
    /// Velocity over ground, which the vessel has from the start and keeps until it is ordered otherwise.
    pub velocity: Velocity,
    /// How much one decision changes.
    pub limits: KinematicConfig,
}

impl DynamicsConfig {
    /// A vessel under way on a straight course.
    ///
    /// Kinematic vessels move over ground as they are told. A ship makes its way through the water: in a
    /// current its bow points, and its speed is, such that its velocity over ground is as asked; wind
    /// sets it off.
    #[must_use]
    pub fn launch(&self, start: &Launch, surroundings: Surroundings) -> Box<dyn Steered> {
        let Launch { position, velocity, limits } = *start;
        match self.dynamics {
            Dynamics::Kinematic => {
                Box::new(Kinematic::new(limits, position, velocity.course(), velocity.speed_mps()))
            }
            Dynamics::Kvlcc2 => {
                let through_water = velocity - surroundings.current;
                Box::new(MmgShip::new(
                    self.kvlcc2.mmg(limits.max_turn_deg),
                    surroundings,
                    position,
                    through_water.course(),
                    through_water.speed_mps(),
                ))
            }
        }
    }

    /// The state in which [`Self::launch`] leaves a vessel.
    #[must_use]
    pub fn start(&self, start: &Launch, surroundings: Surroundings) -> VesselState {
        self.launch(start, surroundings).state()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Nautical;
    use crate::vessel::Command;

    fn eastward(speed_mps: f64) -> Launch {
        let velocity = Velocity::from_course(Nautical::from_degrees(90.0), speed_mps);
        Launch { position: Position::ORIGIN, velocity, limits: KinematicConfig::default() }
    }

    #[test]
    fn a_config_file_chooses_the_dynamics() {
        let config: DynamicsConfig =
            toml::from_str("dynamics = \"kvlcc2\"\nkvlcc2.length_m = 100.0").expect("a config");
        assert_eq!((config.dynamics, config.kvlcc2.length_m), (Dynamics::Kvlcc2, 100.0));
        assert!(toml::from_str::<DynamicsConfig>("dynamics = \"submarine\"").is_err());
        for (word, dynamics) in Dynamics::WORDS {
            assert_eq!(dynamics.word(), word);
            let config: DynamicsConfig = toml::from_str(&format!("dynamics = \"{word}\"")).expect("a config");
            let ship = config.launch(&eastward(4.0), Surroundings::default());
            assert!((ship.max_turn_rad() - 2.4_f64.to_radians()).abs() < 1e-12);
            assert!((ship.state().velocity.speed_mps() - 4.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_ship_heads_up_against_the_current_to_make_its_course_over_ground() {
        let current = Velocity { north_mps: 2.0, east_mps: 0.0 };
        let surroundings = Surroundings { current, wind: None };
        let config = DynamicsConfig { dynamics: Dynamics::Kvlcc2, ..DynamicsConfig::default() };
        let mut ship = config.launch(&eastward(7.0), surroundings);
        assert!((ship.state().heading.degrees() - (90.0 + (2.0_f64 / 7.0).atan().to_degrees())).abs() < 1e-9);
        ship.order(Command::default());
        for _ in 0..60 {
            ship.advance(5.0);
        }
        let state = ship.state();
        assert!(state.position.north_m.abs() < 1.0, "{state:?}");
        assert!((state.velocity.speed_mps() - 7.0).abs() < 0.07, "{state:?}");
        let kinematic = DynamicsConfig::default().start(&eastward(7.0), surroundings);
        assert_eq!(kinematic.heading.degrees(), 90.0);
    }
}
