//! Straight on at constant speed: the linear part of every motion of the paper's section "Problem
//! description".

use super::{Motion, VesselState};
use crate::angle::Nautical;
use crate::geo::{Position, Velocity};

/// `p_k = p_0 + v t_k`, bow ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear {
    start: Position,
    velocity: Velocity,
    heading: Nautical,
    dt_s: f64,
}

impl Linear {
    /// From its position at step 0, its velocity and the time between two steps.
    #[must_use]
    pub fn new(start: Position, velocity: Velocity, dt_s: f64) -> Self {
        Self { start, velocity, heading: velocity.course(), dt_s }
    }

    /// The constant velocity.
    #[must_use]
    pub fn velocity(&self) -> Velocity {
        self.velocity
    }

    /// Time between two steps, in seconds.
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }
}

impl Motion for Linear {
    fn position(&self, step: i64) -> Position {
        self.start + self.velocity.for_seconds(step as f64 * self.dt_s)
    }

    fn state(&self, step: i64) -> VesselState {
        VesselState { position: self.position(step), velocity: self.velocity, heading: self.heading }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn past_and_future_lie_on_one_line() {
        let velocity = Velocity::from_course(Nautical::from_degrees(90.0), 4.0);
        let motion = Linear::new(Position { north_m: 7.0, east_m: 0.0 }, velocity, 5.0);
        assert!(motion.position(3).distance_m(Position { north_m: 7.0, east_m: 60.0 }) < 1e-9);
        assert!(motion.position(-2).distance_m(Position { north_m: 7.0, east_m: -40.0 }) < 1e-9);
        assert!((motion.state(1).heading.degrees() - 90.0).abs() < 1e-9);
    }

    #[test]
    fn history_ends_at_the_step_asked_for() {
        let motion = Linear::new(Position::ORIGIN, Velocity { north_mps: 1.0, east_mps: 0.0 }, 5.0);
        let mut history = [Position::ORIGIN; 4];
        motion.history(2, &mut history);
        assert_eq!(history.map(|position| position.north_m), [-5.0, 0.0, 5.0, 10.0]);
    }
}
