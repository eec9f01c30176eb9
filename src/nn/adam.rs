//! Adam (Kingma & Ba 2015, algorithm 1), in the form PyTorch computes it.

use serde::{Deserialize, Serialize};

use super::matmul::Shared;
use super::simd::{Kernel, Simd};
use super::{Buffer, Compute, Gradients, Layout, Parameters, Real};

/// Settings of [`Adam`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamConfig {
    /// Decay of the first moment, `beta_1`.
    pub beta_1: f64,
    /// Decay of the second moment, `beta_2`.
    pub beta_2: f64,
    /// Added to the root of the second moment.
    pub epsilon: f64,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self { beta_1: 0.9, beta_2: 0.999, epsilon: 1e-8 }
    }
}

/// Moments of the gradients of one network.
#[derive(Debug, Clone)]
pub struct Adam<T> {
    config: AdamConfig,
    first: Buffer<T>,
    second: Buffer<T>,
    steps: u64,
}

impl<T: Real> Adam<T> {
    /// Moments at zero, no step taken.
    pub fn new(layout: &Layout, config: AdamConfig) -> Self {
        Self { config, first: Buffer::zeros(layout.len()), second: Buffer::zeros(layout.len()), steps: 0 }
    }

    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// First and second moments, in the layout of the parameters.
    pub fn moments(&self) -> (&[T], &[T]) {
        (&self.first, &self.second)
    }

    /// Puts back what [`steps`](Self::steps) and [`moments`](Self::moments) gave, to resume.
    pub fn restore(&mut self, steps: u64, fill: impl FnOnce(&mut [T], &mut [T])) {
        self.steps = steps;
        fill(&mut self.first, &mut self.second);
    }

    /// One step with the given learning rate.
    pub fn step(
        &mut self,
        compute: &mut Compute,
        parameters: &mut Parameters<T>,
        gradients: &Gradients<T>,
        learning_rate: f64,
    ) {
        assert_eq!(self.first.len(), gradients.values().len());
        self.steps += 1;
        let corrected = |beta: f64| 1.0 - beta.powf(self.steps as f64);
        let rule = Rule {
            beta_1: T::from_f64(self.config.beta_1),
            rest_1: T::from_f64(1.0 - self.config.beta_1),
            beta_2: T::from_f64(self.config.beta_2),
            rest_2: T::from_f64(1.0 - self.config.beta_2),
            epsilon: T::from_f64(self.config.epsilon),
            rate: T::from_f64(learning_rate / corrected(self.config.beta_1)),
            root_scale: T::from_f64(1.0 / corrected(self.config.beta_2).sqrt()),
        };
        let isa = compute.isa();
        let (first, second) = (Shared::new(&mut self.first), Shared::new(&mut self.second));
        parameters.update_with(compute, |compute, values| {
            let (count, weights) = (values.len(), Shared::new(values));
            compute.split(count, GRAIN, count * OPERATIONS, &|part| {
                // SAFETY: parts are disjoint.
                let (weights, first, second) = unsafe {
                    (weights.range(part.clone()), first.range(part.clone()), second.range(part.clone()))
                };
                T::dispatch(
                    isa,
                    Update { rule, weights, gradients: &gradients.values()[part], first, second },
                );
            });
        });
    }
}

/// Elements cut apart between threads: whole vectors of any instruction set.
const GRAIN: usize = 64;

/// What the step of one weight costs, in multiply-adds of a matrix product.
const OPERATIONS: usize = 16;

#[derive(Clone, Copy)]
struct Rule<T> {
    beta_1: T,
    rest_1: T,
    beta_2: T,
    rest_2: T,
    epsilon: T,
    rate: T,
    root_scale: T,
}

struct Update<'a, T> {
    rule: Rule<T>,
    weights: &'a mut [T],
    gradients: &'a [T],
    first: &'a mut [T],
    second: &'a mut [T],
}

impl<T: Real> Kernel<T> for Update<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        let rule = self.rule;
        let [beta_1, rest_1, beta_2, rest_2, epsilon, rate, root_scale] =
            [rule.beta_1, rule.rest_1, rule.beta_2, rule.rest_2, rule.epsilon, rule.rate, rule.root_scale]
                .map(|x| simd.splat(x));
        let slices = self.weights.chunks_mut(S::LANES).zip(self.gradients.chunks(S::LANES));
        let moments = self.first.chunks_mut(S::LANES).zip(self.second.chunks_mut(S::LANES));
        for ((weight, gradient), (first, second)) in slices.zip(moments) {
            let g = simd.read(gradient);
            let m = simd.mul_add(beta_1, simd.read(first), simd.mul(rest_1, g));
            let v = simd.mul_add(beta_2, simd.read(second), simd.mul(rest_2, simd.mul(g, g)));
            let root = simd.mul_add(simd.sqrt(v), root_scale, epsilon);
            let change = simd.mul(rate, simd.div(m, root));
            simd.write(weight, simd.sub(simd.read(weight), change));
            simd.write(first, m);
            simd.write(second, v);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::nn::{Activation, Dense, Isa};

    fn layout() -> Arc<Layout> {
        let mut layout = Layout::new();
        Dense::new(&mut layout, "linear", 50, 130, Activation::Identity);
        Arc::new(layout)
    }

    fn fill(layout: &Layout, values: &mut [f32], step: u64) {
        for (index, position) in layout.tensors().iter().flat_map(|t| t.positions()).enumerate() {
            values[position] = ((index as f32 + step as f32) * 0.37).sin();
        }
    }

    fn trained(isa: Isa, threads: usize) -> Vec<f32> {
        let layout = layout();
        let mut compute = Compute::with_isa(isa, threads).unwrap();
        let mut parameters = Parameters::zeros(&layout, true);
        let mut gradients = Gradients::zeros(&layout);
        let mut adam = Adam::new(&layout, AdamConfig::default());
        for step in 0..5 {
            fill(&layout, gradients.values_mut(), step);
            adam.step(&mut compute, &mut parameters, &gradients, 1e-2);
        }
        parameters.values().to_vec()
    }

    #[test]
    fn the_first_step_is_the_learning_rate_against_the_sign() {
        let layout = layout();
        let mut parameters = Parameters::<f64>::zeros(&layout, true);
        let mut gradients = Gradients::zeros(&layout);
        let position = layout.tensors()[0].positions().nth(77).unwrap();
        gradients.values_mut()[position] = -3.0;
        let mut adam = Adam::new(&layout, AdamConfig::default());
        adam.step(&mut Compute::new(1), &mut parameters, &gradients, 0.5);
        assert!((parameters.values()[position] - 0.5).abs() < 1e-8);
        assert_eq!(parameters.values().iter().filter(|&&w| w != 0.0).count(), 1);
    }

    #[test]
    fn instruction_sets_agree_and_threads_do_not_change_a_bit() {
        let expected = trained(Isa::Portable, 1);
        for isa in Isa::available() {
            let one = trained(isa, 1);
            assert!(one.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-6), "{isa:?}");
            assert_eq!(trained(isa, 2), one, "{isa:?}");
        }
    }

    #[test]
    fn restored_moments_go_on_as_if_never_stopped() {
        let layout = layout();
        let mut compute = Compute::new(1);
        let mut gradients = Gradients::<f32>::zeros(&layout);
        fill(&layout, gradients.values_mut(), 0);
        let mut adam = Adam::new(&layout, AdamConfig::default());
        let mut parameters = Parameters::zeros(&layout, true);
        adam.step(&mut compute, &mut parameters, &gradients, 1e-2);

        let mut resumed = Adam::new(&layout, AdamConfig::default());
        let (first, second) = adam.moments();
        resumed.restore(adam.steps(), |f, s| {
            f.copy_from_slice(first);
            s.copy_from_slice(second);
        });
        let mut other = parameters.clone();
        adam.step(&mut compute, &mut parameters, &gradients, 1e-2);
        resumed.step(&mut compute, &mut other, &gradients, 1e-2);
        assert_eq!(parameters.values(), other.values());
    }
}
