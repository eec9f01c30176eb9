//! What the layers' tests share: random data and central finite differences.

use rand::{Rng, RngExt};

use super::{Gradients, Parameters, Real};

/// `count` numbers, uniform in `-1..1`.
pub(crate) fn random<T: Real>(rng: &mut impl Rng, count: usize) -> Vec<T> {
    (0..count).map(|_| T::from_f64(rng.random_range(-1.0..1.0))).collect()
}

/// `sum w y`, a loss whose gradient with respect to `y` is `w`.
pub(crate) fn weighted_sum(weights: &[f64], outputs: &[f64]) -> f64 {
    weights.iter().zip(outputs).map(|(w, y)| w * y).sum()
}

const STEP: f64 = 1e-5;

fn assert_close(what: &str, index: usize, analytic: f64, difference: f64) {
    let error = (analytic - difference).abs();
    assert!(error <= 1e-8 + 1e-7 * difference.abs(), "{what}[{index}]: {analytic} against {difference}");
}

/// Compares a gradient with respect to `inputs` with central differences of `loss`.
pub(crate) fn check_inputs(inputs: &[f64], gradient: &[f64], mut loss: impl FnMut(&[f64]) -> f64) {
    let mut moved = inputs.to_vec();
    for index in 0..inputs.len() {
        let mut at = |offset: f64| {
            moved[index] = inputs[index] + offset;
            loss(&moved)
        };
        let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        moved[index] = inputs[index];
        assert_close("input", index, gradient[index], difference);
    }
}

/// Compares the gradients of all weights with central differences of `loss`; padding must have none.
pub(crate) fn check_weights(
    parameters: &Parameters<f64>,
    gradients: &Gradients<f64>,
    mut loss: impl FnMut(&Parameters<f64>) -> f64,
) {
    let mut moved = parameters.clone();
    let mut padding = vec![true; parameters.values().len()];
    for tensor in parameters.layout().tensors() {
        for (index, position) in tensor.positions().enumerate() {
            let value = parameters.values()[position];
            let mut at = |offset: f64| {
                moved.update(|values| values[position] = value + offset);
                loss(&moved)
            };
            let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            moved.update(|values| values[position] = value);
            assert_close(tensor.name(), index, gradients.values()[position], difference);
            padding[position] = false;
        }
    }
    let padding = padding.iter().zip(gradients.values()).filter(|(padding, _)| **padding);
    assert!(padding.into_iter().all(|(_, &gradient)| gradient == 0.0), "padding has gradients");
}
