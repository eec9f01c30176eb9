//! The random streams of an episode: one per purpose and vessel, all from one seed, so that none
//! depends on how often another was asked.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::model::SensorNoise;
use crate::geo::{Displacement, Position};

/// What a stream is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Drawing the start of a recorded vessel.
    Start = 1,
    /// The random part of a vessel's motion.
    Motion = 2,
    /// The noise of a vessel's position sensor.
    Sensor = 3,
}

/// The stream of one purpose and vessel (own ship is 0, the targets follow) in the episode of `seed`.
#[must_use]
pub fn stream(seed: u64, purpose: Purpose, vessel: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(((purpose as u64) << 32) | vessel as u64);
    rng
}

/// Measures the position of one vessel with a normal error on each axis, drawn anew at every time
/// step (section 5.2 of the paper's noise analysis).
///
/// The errors are standard normal draws times sigma: for one seed they are the same whatever the
/// policy does, and proportional for different sigmas.
#[derive(Debug, Clone)]
pub struct PositionSensor {
    rng: ChaCha8Rng,
    sigma_m: f64,
}

impl PositionSensor {
    /// The sensor of one vessel in the episode of `seed`.
    #[must_use]
    pub fn new(seed: u64, vessel: usize, noise: SensorNoise) -> Self {
        Self { rng: stream(seed, Purpose::Sensor, vessel), sigma_m: noise.sigma_m }
    }

    /// The measured position; to be called once per time step.
    pub fn measure(&mut self, position: Position) -> Position {
        position + normal_displacement(&mut self.rng) * self.sigma_m
    }
}

/// Independent standard normal draws on north and on east, in metres.
fn normal_displacement(rng: &mut impl Rng) -> Displacement {
    Displacement { north_m: StandardNormal.sample(rng), east_m: StandardNormal.sample(rng) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(seed: u64, vessel: usize, sigma_m: f64) -> Vec<Position> {
        let mut sensor = PositionSensor::new(seed, vessel, SensorNoise { sigma_m });
        (0..2000).map(|_| sensor.measure(Position::ORIGIN)).collect()
    }

    #[test]
    fn errors_have_the_standard_deviation_asked_for_on_each_axis() {
        let errors = errors(7, 0, 10.0);
        for axis in [|p: &Position| p.north_m, |p: &Position| p.east_m] {
            let mean = errors.iter().map(axis).sum::<f64>() / errors.len() as f64;
            let variance = errors.iter().map(|p| (axis(p) - mean).powi(2)).sum::<f64>() / errors.len() as f64;
            assert!(mean.abs() < 1.0, "{mean}");
            assert!((variance.sqrt() - 10.0).abs() < 0.6, "{}", variance.sqrt());
        }
    }

    #[test]
    fn vessels_and_seeds_have_their_own_errors_and_sigma_scales_them() {
        assert_ne!(errors(7, 0, 10.0), errors(7, 1, 10.0));
        assert_ne!(errors(7, 0, 10.0), errors(8, 0, 10.0));
        for (small, large) in errors(7, 1, 5.0).iter().zip(errors(7, 1, 20.0)) {
            assert!((4.0 * small.north_m - large.north_m).abs() < 1e-9);
        }
        assert!(errors(7, 0, 0.0).iter().all(|position| *position == Position::ORIGIN));
    }
}
