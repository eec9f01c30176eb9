//! How one vessel moves: one file per kind of motion.
//!
//! A [`Motion`] is known beforehand: its state at any time step, past ones included, follows from
//! how it was built ([`recorded`], [`linear`], [`waypoints`], [`stochastic`], [`periodic`],
//! [`piloted`]). A [`Steered`] vessel is moved on step by step under orders ([`kinematic`], [`mmg`]).
//!
//! Time steps are `dt_s` apart and step 0 is the start of the scenario; history has negative steps.

use std::fmt;

use crate::angle::Nautical;
use crate::geo::{Position, Velocity};

pub mod dynamics;
pub mod kinematic;
pub mod linear;
pub mod mmg;
pub mod offsets;
pub mod periodic;
pub mod piloted;
pub mod recorded;
pub mod stochastic;
pub mod waypoints;

pub use dynamics::{Dynamics, DynamicsConfig, Launch};
pub use kinematic::{Kinematic, KinematicConfig};
pub use linear::Linear;
pub use mmg::{Kvlcc2Config, MmgConfig, MmgShip};
pub use offsets::{OffsetProcess, Span, Wandering};
pub use periodic::PeriodicConfig;
pub use piloted::{Pilot, PilotConfig, Piloted};
pub use recorded::Recorded;
pub use stochastic::StochasticConfig;
pub use waypoints::{Waypoint, Waypoints, WaypointsError};

/// Where a vessel is, how it moves over ground and where its bow points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VesselState {
    /// Its reference point: midship, on the centre line.
    pub position: Position,
    /// Velocity over ground.
    pub velocity: Velocity,
    /// Direction of the bow.
    pub heading: Nautical,
}

impl VesselState {
    /// A vessel that moves the way its bow points.
    #[must_use]
    pub fn on_course(position: Position, course: Nautical, speed_mps: f64) -> Self {
        Self { position, velocity: Velocity::from_course(course, speed_mps), heading: course }
    }
}

/// A motion that is fixed once it is built.
pub trait Motion: fmt::Debug + Send + Sync {
    /// Where the vessel is at a time step; negative steps lie before the start of the scenario.
    fn position(&self, step: i64) -> Position;

    /// Position, velocity and heading at a time step.
    fn state(&self, step: i64) -> VesselState;

    /// Fills `positions` with the latest positions up to and including `step`, oldest first.
    fn history(&self, step: i64, positions: &mut [Position]) {
        let first = step + 1 - positions.len() as i64;
        for (k, position) in (first..).zip(positions) {
            *position = self.position(k);
        }
    }
}

/// What a policy asks of the vessel it steers, once per decision.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Change of the ordered heading, in radians, positive to starboard. The vessel clips it to
    /// [`Steered::max_turn_rad`].
    pub turn_rad: f64,
    /// A new ordered speed through the water, in metres per second; `None` keeps the last one.
    pub speed_mps: Option<f64>,
}

/// A vessel that is moved on step by step under orders.
pub trait Steered: fmt::Debug + Send + Sync {
    /// The present state.
    fn state(&self) -> VesselState;

    /// The heading last ordered, which a turn of the next command is counted from.
    fn ordered_heading(&self) -> Nautical;

    /// The largest change of the ordered heading in one decision, in radians.
    fn max_turn_rad(&self) -> f64;

    /// Takes the command of a decision; it holds until the next.
    fn order(&mut self, command: Command);

    /// Moves on by `dt_s` seconds.
    fn advance(&mut self, dt_s: f64);
}
