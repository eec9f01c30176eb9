//! Fully connected layer.

use super::elementwise::PullBack;
use super::layout::{PANEL, Place};
use super::matmul::{ColumnSums, OuterProduct, Product, Shared, Start, Strides};
use super::{Activation, Compute, Gradients, Layout, Parameters, Real};

/// `y = activation(x W^T + b)`, PyTorch's `Linear` with what follows it.
#[derive(Debug, Clone, Copy)]
pub struct Dense {
    inputs: usize,
    outputs: usize,
    activation: Activation,
    weight: Place,
    bias: Place,
}

/// Rows cut apart between threads: a multiple of the tile's height.
const ROW_GRAIN: usize = 8;

impl Dense {
    /// Adds `{name}.weight` of shape `[outputs, inputs]` and `{name}.bias` of shape `[outputs]` to a network.
    pub fn new(
        layout: &mut Layout,
        name: &str,
        inputs: usize,
        outputs: usize,
        activation: Activation,
    ) -> Self {
        let bound = 1.0 / (inputs as f64).sqrt();
        let weight = layout.add_matrix(format!("{name}.weight"), outputs, 1, inputs, bound);
        let bias = layout.add_bias(format!("{name}.bias"), outputs, 1, bound);
        Self { inputs, outputs, activation, weight, bias }
    }

    /// Length of an input vector.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Length of an output vector.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Multiply-adds of one forward pass.
    pub fn operations(&self, rows: usize) -> usize {
        rows * self.inputs * self.outputs
    }

    /// Fills `output[rows][outputs]` from `input[rows][inputs]`.
    pub fn forward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        rows: usize,
        output: &mut [T],
    ) {
        assert!(input.len() >= rows * self.inputs && output.len() >= rows * self.outputs);
        let isa = compute.isa();
        let (input, output) = (Source(input.as_ptr()), Shared::new(output));
        let weight = parameters.at(self.weight);
        let bias = Source(parameters.at(self.bias).as_ptr());
        compute.split(rows, ROW_GRAIN, self.operations(rows), &|part| {
            let product = Product {
                a: input.at(part.start * self.inputs),
                a_strides: Strides::row_major(rows, self.inputs),
                b: weight.as_ptr(),
                panel_rows: self.inputs,
                c: output.pointer(part.start * self.outputs),
                c_strides: Strides::row_major(rows, self.outputs),
                steps: 1,
                rows: part.len(),
                inner: self.inputs,
                columns: self.outputs,
                start: Start::Bias(bias.at(0)),
                activation: self.activation,
            };
            // SAFETY: sizes checked above; parts are disjoint rows of the output.
            unsafe { product.run(isa) }
        });
    }

    /// Carries gradients back through the layer.
    ///
    /// `input` and `output` are those of the forward pass; `d_output[rows][outputs]` is the gradient of the
    /// loss with respect to `output` and is overwritten by that before the activation. Adds to `gradients` and
    /// fills `d_input[rows][inputs]`, each if given.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        output: &[T],
        rows: usize,
        d_output: &mut [T],
        d_input: Option<&mut [T]>,
        gradients: Option<&mut Gradients<T>>,
    ) {
        assert!(input.len() >= rows * self.inputs && output.len() >= rows * self.outputs);
        let (output, d_output) = (&output[..rows * self.outputs], &mut d_output[..rows * self.outputs]);
        if self.activation != Activation::Identity {
            let work = PullBack { activation: self.activation, outputs: output, gradient: d_output };
            T::dispatch(compute.isa(), work);
        }
        if let Some(d_input) = d_input {
            self.backward_input(compute, parameters, rows, d_output, d_input);
        }
        if let Some(gradients) = gradients {
            self.backward_weights(compute, input, rows, d_output, gradients);
        }
    }

    fn backward_input<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        rows: usize,
        d_output: &[T],
        d_input: &mut [T],
    ) {
        assert!(d_input.len() >= rows * self.inputs);
        let isa = compute.isa();
        let (d_output, d_input) = (Source(d_output.as_ptr()), Shared::new(d_input));
        let weight = parameters.transposed_at(self.weight);
        compute.split(rows, ROW_GRAIN, self.operations(rows), &|part| {
            let product = Product {
                a: d_output.at(part.start * self.outputs),
                a_strides: Strides::row_major(rows, self.outputs),
                b: weight.as_ptr(),
                panel_rows: self.weight.padded_outputs(),
                c: d_input.pointer(part.start * self.inputs),
                c_strides: Strides::row_major(rows, self.inputs),
                steps: 1,
                rows: part.len(),
                inner: self.outputs,
                columns: self.inputs,
                start: Start::Zero,
                activation: Activation::Identity,
            };
            // SAFETY: sizes checked above; parts are disjoint rows of the gradient.
            unsafe { product.run(isa) }
        });
    }

    fn backward_weights<T: Real>(
        &self,
        compute: &mut Compute,
        input: &[T],
        rows: usize,
        d_output: &[T],
        gradients: &mut Gradients<T>,
    ) {
        let isa = compute.isa();
        let strides = Strides::row_major(rows, self.outputs);
        let sums = ColumnSums {
            dc: d_output.as_ptr(),
            dc_strides: strides,
            db: gradients.at_mut(self.bias).as_mut_ptr(),
            steps: 1,
            rows,
            columns: self.outputs,
            panel_start: 0,
            panel_end: self.outputs.div_ceil(PANEL),
        };
        // SAFETY: sizes checked by the caller; the bias is padded to whole panels.
        unsafe { sums.run(isa) };

        let (input, d_output) = (Source(input.as_ptr()), Source(d_output.as_ptr()));
        let weight = Shared::new(gradients.at_mut(self.weight));
        // Inputs are cut, not outputs: there may be a single panel of outputs.
        compute.split(self.inputs, ROW_GRAIN, self.operations(rows), &|part| {
            let product = OuterProduct {
                a: input.at(0),
                a_strides: Strides::row_major(rows, self.inputs),
                dc: d_output.at(0),
                dc_strides: strides,
                dw: weight.pointer(0),
                steps: 1,
                rows,
                inner: self.inputs,
                inner_start: part.start,
                inner_end: part.end,
                columns: self.outputs,
                panel_start: 0,
                panel_end: self.outputs.div_ceil(PANEL),
            };
            // SAFETY: sizes checked by the caller; parts are disjoint inputs of the weights.
            unsafe { product.run(isa) }
        });
    }
}

/// The start of a slice that outlives the work of several threads, which only read it.
pub(super) struct Source<T>(pub *const T);

impl<T> Source<T> {
    pub fn at(&self, offset: usize) -> *const T {
        self.0.wrapping_add(offset)
    }
}

// SAFETY: only read, through kernels whose callers keep the slice alive.
unsafe impl<T: Sync> Sync for Source<T> {}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::nn::Isa;
    use crate::nn::testing::{check_inputs, check_weights, random, weighted_sum};

    const ACTIVATIONS: [Activation; 4] =
        [Activation::Identity, Activation::Relu, Activation::LeakyRelu { slope: 0.01 }, Activation::Tanh];

    /// Sizes that meet every kind of tile and of edge.
    const SIZES: [(usize, usize, usize); 5] = [(1, 1, 1), (3, 5, 2), (33, 20, 11), (7, 34, 9), (40, 49, 4)];

    fn outputs(layer: &Dense, parameters: &Parameters<f64>, input: &[f64], rows: usize) -> Vec<f64> {
        let mut output = vec![0.0; rows * layer.outputs];
        layer.forward(&mut Compute::new(1), parameters, input, rows, &mut output);
        output
    }

    #[test]
    fn gradients_are_central_differences() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for activation in ACTIVATIONS {
            for (inputs, outputs_, rows) in SIZES {
                let mut layout = Layout::new();
                let layer = Dense::new(&mut layout, "linear", inputs, outputs_, activation);
                let parameters = Parameters::initialised(&Arc::new(layout), &mut rng);
                let input = random(&mut rng, rows * inputs);
                let weights: Vec<f64> = random(&mut rng, rows * outputs_);

                let output = outputs(&layer, &parameters, &input, rows);
                let mut gradients = Gradients::zeros(parameters.layout());
                let mut d_input = vec![f64::NAN; input.len()];
                layer.backward(
                    &mut Compute::new(1),
                    &parameters,
                    &input,
                    &output,
                    rows,
                    &mut weights.clone(),
                    Some(&mut d_input),
                    Some(&mut gradients),
                );
                check_inputs(&input, &d_input, |input| {
                    weighted_sum(&weights, &outputs(&layer, &parameters, input, rows))
                });
                check_weights(&parameters, &gradients, |parameters| {
                    weighted_sum(&weights, &outputs(&layer, parameters, &input, rows))
                });
            }
        }
    }

    #[test]
    fn forward_is_the_textbook_sum() {
        let mut layout = Layout::new();
        let layer = Dense::new(&mut layout, "linear", 3, 2, Activation::Relu);
        let mut parameters = Parameters::zeros(&Arc::new(layout), false);
        let layout = Arc::clone(parameters.layout());
        parameters.update(|values| {
            layout.scatter(&layout.tensors()[0], &[1.0, 2.0, 3.0, -1.0, -2.0, -3.0], values);
            layout.scatter(&layout.tensors()[1], &[0.5, 40.0], values);
        });
        assert_eq!(outputs(&layer, &parameters, &[1.0, 1.0, 1.0, 4.0, 5.0, 6.0], 2), [6.5, 34.0, 32.5, 8.0]);
        assert_eq!(outputs(&layer, &parameters, &[-1.0, -1.0, -1.0], 1), [0.0, 46.0]);
    }

    /// Everything a layer computes, on given instructions and threads.
    fn everything(
        isa: Isa,
        threads: usize,
        activation: Activation,
        sizes: (usize, usize, usize),
    ) -> Vec<f32> {
        let (inputs, outputs, rows) = sizes;
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut layout = Layout::new();
        let layer = Dense::new(&mut layout, "linear", inputs, outputs, activation);
        let parameters = Parameters::<f32>::initialised(&Arc::new(layout), &mut rng);
        let input = random(&mut rng, rows * inputs);
        let mut d_output: Vec<f32> = random(&mut rng, rows * outputs);
        let (mut output, mut d_input) = (vec![0.0; rows * outputs], vec![0.0; rows * inputs]);
        let mut gradients = Gradients::zeros(parameters.layout());
        let mut compute = Compute::with_isa(isa, threads).unwrap();
        layer.forward(&mut compute, &parameters, &input, rows, &mut output);
        let (d_in, grads) = (Some(&mut d_input[..]), Some(&mut gradients));
        layer.backward(&mut compute, &parameters, &input, &output, rows, &mut d_output, d_in, grads);
        [&output, &d_input, gradients.values()].concat()
    }

    #[test]
    fn all_instruction_sets_agree() {
        for activation in ACTIVATIONS {
            for sizes in SIZES.into_iter().chain([(258, 256, 32)]) {
                let expected = everything(Isa::Portable, 1, activation, sizes);
                for isa in Isa::available() {
                    for (a, b) in everything(isa, 1, activation, sizes).iter().zip(&expected) {
                        assert!((a - b).abs() <= 2e-5, "{isa:?} {activation:?} {sizes:?}: {a} against {b}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        for isa in Isa::available() {
            for sizes in [(258, 256, 32), (131, 20, 77), (64, 64, 20)] {
                let one = everything(isa, 1, Activation::Tanh, sizes);
                for threads in [2, 3] {
                    assert_eq!(everything(isa, threads, Activation::Tanh, sizes), one, "{isa:?} {sizes:?}");
                }
            }
        }
    }

    #[test]
    fn not_a_number_is_passed_on() {
        for isa in Isa::available() {
            for activation in ACTIVATIONS {
                let mut layout = Layout::new();
                let layer = Dense::new(&mut layout, "linear", 3, 20, activation);
                let parameters =
                    Parameters::<f32>::initialised(&Arc::new(layout), &mut ChaCha8Rng::seed_from_u64(3));
                let mut output = vec![0.0; 20];
                let mut compute = Compute::with_isa(isa, 1).unwrap();
                layer.forward(&mut compute, &parameters, &[0.0, f32::NAN, 0.0], 1, &mut output);
                assert!(output.iter().all(|y| y.is_nan()), "{isa:?} {activation:?}");
            }
        }
    }
}
