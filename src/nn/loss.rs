//! Mean squared error.

use super::Real;

/// Mean of `(prediction - target)^2` over all elements, summed in f64; fills `gradient` with the derivative with
/// respect to `prediction`. The slices have equal lengths.
pub fn mean_squared_error<T: Real>(prediction: &[T], target: &[T], gradient: &mut [T]) -> f64 {
    assert!(prediction.len() == target.len() && prediction.len() == gradient.len());
    let count = prediction.len() as f64;
    let scale = T::from_f64(2.0 / count);
    let mut sum = 0.0;
    for ((&prediction, &target), gradient) in prediction.iter().zip(target).zip(gradient) {
        let error = prediction - target;
        *gradient = scale * error;
        sum += (error * error).to_f64();
    }
    sum / count
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::nn::testing::{check_inputs, random};

    #[test]
    fn the_gradient_is_the_central_difference() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (prediction, target): (Vec<f64>, Vec<f64>) = (random(&mut rng, 10), random(&mut rng, 10));
        let mut gradient = vec![0.0; 10];
        mean_squared_error(&prediction, &target, &mut gradient);
        check_inputs(&prediction, &gradient, |p| mean_squared_error(p, &target, &mut [0.0; 10]));
    }

    #[test]
    fn the_mean_is_over_all_elements() {
        assert_eq!(mean_squared_error(&[1.0f32, 2.0], &[0.0, 4.0], &mut [0.0; 2]), 2.5);
    }
}
