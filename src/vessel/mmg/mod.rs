//! Manoeuvring of a full ship in three degrees of freedom: the MMG standard method.
//!
//! After H. Yasukawa and Y. Yoshimura, *Introduction of MMG standard method for ship maneuvering
//! predictions*, J. Mar. Sci. Technol. 20 (2015) 37-52, with the tanker KVLCC2 as the ship.
//! Equation numbers in this module are theirs.
//!
//! | quantity | convention |
//! | --- | --- |
//! | origin | midship, on the centre line |
//! | axes | x forward, y to starboard; heading `psi` and yaw rate `r` positive to starboard |
//! | `u`, `v` | velocity of midship through the water |
//! | rudder angle `delta` | positive turns the ship to starboard |
//! | drift angle `beta` | `atan2(-v, u)`: positive where the ship drifts to port of its bow |
//! | current | the velocity of the water over ground: the direction it sets **towards** |
//! | wind | the direction it blows **from** |
//!
//! [`derivative`](dynamics::derivative) is a pure function of motion, actuators and surroundings;
//! [`MmgShip`] integrates it with the classical fourth-order Runge-Kutta method under a heading
//! autopilot; [`manoeuvre`] runs the standard tests.

pub mod dynamics;
mod kvlcc2;
pub mod manoeuvre;
mod parameters;
pub mod published;
mod ship;

pub use dynamics::{Actuators, Hydrodynamics, MmgMotion, Surroundings, Wind};
pub use kvlcc2::Kvlcc2Config;
pub use parameters::{MmgParameters, ParameterSet, Windage};
pub use ship::{AutopilotConfig, MmgConfig, MmgShip};
