//! What the two random motions share: a linear part plus offsets that a process draws.

use nalgebra::Vector2;
use rand::Rng;

use super::{Linear, Motion, VesselState};
use crate::angle::Nautical;
use crate::geo::{Displacement, Position};

/// A random process of position offsets `q_0, q_1, ...`, in metres, one per time step.
///
/// It knows no compass: offsets are in the right-handed axes that its velocity was given in.
pub trait OffsetProcess {
    /// The next offset; the first call gives `q_0`.
    fn next_offset(&mut self, rng: &mut impl Rng) -> Vector2<f64>;
}

/// How far a random motion is drawn beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// Steps before step 0 whose positions will be asked for.
    pub history_steps: usize,
    /// Steps after step 0.
    pub future_steps: usize,
    /// Steps before step 0 at which the process starts, so that it is stationary by then (or
    /// `history_steps`, where that is more).
    pub burn_in_steps: usize,
}

/// A linear motion with random offsets, drawn once for a [`Span`].
///
/// Beyond the span the offset at its end is held and the linear part goes on. The velocity at step
/// `k` is that of the step from `k` to `k + 1`; the heading is the course from `k - 1` to `k + 1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Wandering {
    linear: Linear,
    offsets: Vec<Displacement>,
    first_step: i64,
}

impl Wandering {
    /// Draws the offsets of a span from a process whose axes are x to the east and y to the north.
    #[must_use]
    pub fn new(linear: Linear, mut process: impl OffsetProcess, span: Span, rng: &mut impl Rng) -> Self {
        // One more on either side serves the headings of the outermost steps.
        let lead = span.history_steps.max(span.burn_in_steps) + 1;
        let offsets = (0..=lead + span.future_steps + 1)
            .map(|_| {
                let offset = process.next_offset(rng);
                Displacement { north_m: offset.y, east_m: offset.x }
            })
            .collect();
        Self { linear, offsets, first_step: -(lead as i64) }
    }

    /// The linear part.
    #[must_use]
    pub fn linear(&self) -> &Linear {
        &self.linear
    }

    /// The non-linear part `q_k` at a step.
    #[must_use]
    pub fn offset(&self, step: i64) -> Displacement {
        let last = self.offsets.len() as i64 - 1;
        self.offsets[(step - self.first_step).clamp(0, last) as usize]
    }
}

impl Motion for Wandering {
    fn position(&self, step: i64) -> Position {
        self.linear.position(step) + self.offset(step)
    }

    fn state(&self, step: i64) -> VesselState {
        let position = self.position(step);
        let after = self.position(step + 1);
        let way = after - self.position(step - 1);
        VesselState {
            position,
            velocity: (after - position).per_seconds(self.linear.dt_s()),
            heading: if way == Displacement::default() { Nautical::NORTH } else { way.bearing() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geo::Velocity;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Offsets to the east that count the calls.
    struct Counter(f64);

    impl OffsetProcess for Counter {
        fn next_offset(&mut self, _: &mut impl Rng) -> Vector2<f64> {
            self.0 += 1.0;
            Vector2::new(self.0 - 1.0, 0.0)
        }
    }

    fn wandering(history_steps: usize, burn_in_steps: usize) -> Wandering {
        let span = Span { history_steps, future_steps: 4, burn_in_steps };
        let linear = Linear::new(Position::ORIGIN, Velocity { north_mps: 2.0, east_mps: 0.0 }, 5.0);
        Wandering::new(linear, Counter(0.0), span, &mut ChaCha8Rng::seed_from_u64(0))
    }

    #[test]
    fn the_process_starts_before_the_vessel_appears() {
        assert_eq!(wandering(3, 60).offset(0).east_m, 61.0);
        assert_eq!(wandering(75, 60).offset(-75).east_m, 1.0);
    }

    #[test]
    fn beyond_the_span_the_linear_part_goes_on() {
        let motion = wandering(2, 2);
        assert_eq!(motion.offset(100), motion.offset(5));
        assert_eq!(motion.state(100).velocity, Velocity { north_mps: 2.0, east_mps: 0.0 });
        assert_eq!(motion.position(-100).north_m, -1000.0);
    }

    #[test]
    fn velocity_is_that_of_the_coming_step() {
        let state = wandering(2, 2).state(1);
        assert_eq!(state.velocity, Velocity { north_mps: 2.0, east_mps: 0.2 });
        assert_eq!(state.heading, Nautical::of(20.0, 2.0));
    }
}
