//! How close two vessels will come, and when: the closest point of approach (CPA).
//!
//! - [`linear`]: the closed form for two straight motions.
//! - [`sampled`]: the smallest smoothed distance over the steps of a forecast.
//! - [`refined`]: the smallest smoothed distance over all times of that forecast.
//! - [`Estimator`] serves many target ships per decision, by either of the last two.
//!
//! Positions and velocities are vectors of one right-handed plane, whichever it is: x east and y
//! north in coastal waters ([`Position::xy`](crate::geo::Position::xy)), x ahead and y to port in
//! the open-water field. Distances and times do not depend on the choice.
//!
//! Time 0 is now. A CPA in the past has a negative time. A position that is not finite, or too few
//! of them, gives [`Cpa::UNKNOWN`].

mod estimator;
pub mod linear;
pub mod refined;
pub mod sampled;

pub use estimator::{CpaConfig, CpaMethod, Estimator, StraightMotion};

use serde::{Deserialize, Serialize};

/// The closest point of approach of two motions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cpa {
    /// Distance at the closest point of approach (DCPA), in metres.
    pub distance_m: f64,
    /// Time to the closest point of approach (TCPA), in seconds; negative once passed.
    pub time_s: f64,
}

impl Cpa {
    /// The outcome where no distance is known: both values are NaN.
    pub const UNKNOWN: Self = Self { distance_m: f64::NAN, time_s: f64::NAN };

    /// Whether both values are finite numbers.
    #[must_use]
    pub fn is_finite(self) -> bool {
        self.distance_m.is_finite() && self.time_s.is_finite()
    }
}
