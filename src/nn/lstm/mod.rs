//! Long short-term memory over whole sequences.

mod backward;
mod forward;
mod gates;
#[cfg(test)]
mod tests;
mod windows;

use crate::nn::dense::Source;
use crate::nn::elementwise::Accumulate;
use crate::nn::layout::{PANEL, Place, padded};
use crate::nn::matmul::Shared;
use crate::nn::{Buffer, Compute, Gradients, Layout, Parameters, Real};
use backward::PassBack;
use forward::Pass;
use gates::GATES;
pub use windows::LstmWindows;

/// One LSTM layer, PyTorch's `LSTM` with one layer and zero initial state: gates in the order input, forget,
/// candidate, output, and two biases, which it sums.
#[derive(Debug, Clone, Copy)]
pub struct Lstm {
    inputs: usize,
    hidden: usize,
    input_weight: Place,
    hidden_weight: Place,
    input_bias: Place,
    hidden_bias: Place,
}

/// What a forward pass leaves for the backward pass, for up to a fixed number of steps and rows.
///
/// Everything is in blocks of 32 hidden units, `[steps][blocks][rows][32]`.
#[derive(Debug, Clone)]
pub struct LstmState<T> {
    blocks: usize,
    hidden: usize,
    capacity: (usize, usize),
    /// Steps and rows of the last forward pass.
    steps: usize,
    rows: usize,
    bias: Buffer<T>,
    /// Activations of the gates; after the backward pass, gradients of their sums.
    gates: Buffer<T>,
    cell: Buffer<T>,
    tanh_cell: Buffer<T>,
    hidden_states: Buffer<T>,
    d_hidden: Buffer<T>,
    d_cell: Buffer<T>,
}

impl<T: Real> LstmState<T> {
    /// The number of steps of the last forward pass that were computed: the longest history's.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Hidden state of `row` after `step` of the last forward pass, unit by unit.
    pub fn hidden(&self, step: usize, row: usize) -> impl Iterator<Item = T> + '_ {
        assert!(step < self.steps && row < self.rows);
        (0..self.hidden).map(move |unit| {
            let block = step * self.blocks + unit / PANEL;
            self.hidden_states[(block * self.rows + row) * PANEL + unit % PANEL]
        })
    }

    /// Copies the hidden state after the last valid step of each row into `output[row * stride..]`, `hidden`
    /// elements each. `lengths` gives the valid steps per row, all of them if `None`; a row without any gets
    /// zeros, the memory of an empty history.
    pub fn read_last(&self, lengths: Option<&[usize]>, output: &mut [T], stride: usize) {
        for (row, output) in output.chunks_mut(stride).take(self.rows).enumerate() {
            let length = lengths.map_or(self.steps, |lengths| lengths[row]);
            let output = &mut output[..self.hidden];
            if length == 0 {
                output.fill(T::ZERO);
                continue;
            }
            for (block, output) in output.chunks_mut(PANEL).enumerate() {
                let from = (((length - 1) * self.blocks + block) * self.rows + row) * PANEL;
                output.copy_from_slice(&self.hidden_states[from..from + output.len()]);
            }
        }
    }
}

impl Lstm {
    /// Adds `{name}.weight_ih_l0` of shape `[4 hidden, inputs]`, `{name}.weight_hh_l0` of shape
    /// `[4 hidden, hidden]`, `{name}.bias_ih_l0` and `{name}.bias_hh_l0` of shape `[4 hidden]` to a network.
    pub fn new(layout: &mut Layout, name: &str, inputs: usize, hidden: usize) -> Self {
        let bound = 1.0 / (hidden as f64).sqrt();
        Self {
            inputs,
            hidden,
            input_weight: layout.add_matrix(format!("{name}.weight_ih_l0"), hidden, GATES, inputs, bound),
            hidden_weight: layout.add_matrix(format!("{name}.weight_hh_l0"), hidden, GATES, hidden, bound),
            input_bias: layout.add_bias(format!("{name}.bias_ih_l0"), hidden, GATES, bound),
            hidden_bias: layout.add_bias(format!("{name}.bias_hh_l0"), hidden, GATES, bound),
        }
    }

    /// Length of an input vector.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of hidden units.
    pub fn hidden(&self) -> usize {
        self.hidden
    }

    /// Multiply-adds of one forward pass.
    pub fn operations(&self, steps: usize, rows: usize) -> usize {
        GATES * rows * self.hidden * (steps * self.inputs + steps.saturating_sub(1) * self.hidden)
    }

    fn blocks(&self) -> usize {
        padded(self.hidden) / PANEL
    }

    /// Buffers for sequences of up to `steps` steps and batches of up to `rows` rows.
    pub fn state<T: Real>(&self, steps: usize, rows: usize) -> LstmState<T> {
        let blocks = self.blocks();
        let one = blocks * rows * PANEL;
        LstmState {
            blocks,
            hidden: self.hidden,
            capacity: (steps, rows),
            steps: 0,
            rows: 0,
            bias: Buffer::zeros(GATES * blocks * PANEL),
            gates: Buffer::zeros(GATES * steps * one),
            cell: Buffer::zeros(steps * one),
            tanh_cell: Buffer::zeros(steps * one),
            hidden_states: Buffer::zeros(steps * one),
            d_hidden: Buffer::zeros(one),
            d_cell: Buffer::zeros(one),
        }
    }

    /// Runs over `input[steps][rows][inputs]` from zero states.
    ///
    /// `lengths`, if given, holds the number of valid steps of each row, valid ones first; what follows is
    /// padding and must be finite. Steps beyond the longest row are not computed.
    #[allow(clippy::too_many_arguments)]
    pub fn forward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        steps: usize,
        rows: usize,
        lengths: Option<&[usize]>,
        state: &mut LstmState<T>,
    ) {
        assert!(steps <= state.capacity.0 && rows <= state.capacity.1 && state.hidden == self.hidden);
        assert!(input.len() >= steps * rows * self.inputs);
        if let Some(lengths) = lengths {
            assert!(lengths.len() >= rows && lengths[..rows].iter().all(|&n| n <= steps));
        }
        let steps = lengths.map_or(steps, |lengths| lengths[..rows].iter().copied().max().unwrap_or(0));
        (state.steps, state.rows) = (steps, rows);
        self.sum_biases(compute, parameters, state);
        let pass = self.pass(compute, parameters, input, state);
        compute.split(rows, ROW_GRAIN, self.operations(steps, rows), &|part| {
            // SAFETY: sizes checked above; parts are disjoint rows of every buffer that is written.
            unsafe {
                pass.project(0..steps, part.clone());
                for step in 0..steps {
                    pass.step(step, step.checked_sub(1), part.clone());
                }
            }
        });
    }

    fn sum_biases<T: Real>(&self, compute: &Compute, parameters: &Parameters<T>, state: &mut LstmState<T>) {
        state.bias.copy_from_slice(parameters.at(self.input_bias));
        let sum = Accumulate { target: &mut state.bias, source: parameters.at(self.hidden_bias) };
        T::dispatch(compute.isa(), sum);
    }

    /// A pass over the rows of `state`, whose biases are summed.
    fn pass<'a, T: Real>(
        &'a self,
        compute: &Compute,
        parameters: &'a Parameters<T>,
        input: &'a [T],
        state: &'a mut LstmState<T>,
    ) -> Pass<'a, T> {
        Pass {
            layer: self,
            isa: compute.isa(),
            input: Source(input.as_ptr()),
            bias: Source(state.bias.as_ptr()),
            input_weight: Source(parameters.at(self.input_weight).as_ptr()),
            hidden_weight: Source(parameters.at(self.hidden_weight).as_ptr()),
            gates: Shared::new(&mut state.gates),
            cell: Shared::new(&mut state.cell),
            tanh_cell: Shared::new(&mut state.tanh_cell),
            hidden: Shared::new(&mut state.hidden_states),
            rows: state.rows,
        }
    }

    /// Carries gradients back through time, after [`forward`](Self::forward) with the same arguments.
    ///
    /// `d_last[row * stride..]` is the gradient with respect to the hidden state of each row after its last
    /// valid step. Adds to `gradients` and fills `d_input[steps][rows][inputs]`, each if given; steps that were
    /// not computed get zeros there. Uses up `state`.
    #[allow(clippy::too_many_arguments)]
    pub fn backward<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        lengths: Option<&[usize]>,
        state: &mut LstmState<T>,
        (d_last, stride): (&[T], usize),
        d_input: Option<&mut [T]>,
        gradients: Option<&mut Gradients<T>>,
    ) {
        let (steps, rows) = (state.steps, state.rows);
        assert!(input.len() >= steps * rows * self.inputs);
        assert!(rows == 0 || d_last.len() >= (rows - 1) * stride + self.hidden);
        let d_input = d_input.map(|d_input| {
            let (computed, rest) = d_input.split_at_mut(steps * rows * self.inputs);
            rest.fill(T::ZERO);
            computed
        });
        let back = PassBack {
            layer: self,
            isa: compute.isa(),
            steps,
            rows,
            lengths,
            hidden_weight: Source(parameters.transposed_at(self.hidden_weight).as_ptr()),
            input_weight: Source(parameters.transposed_at(self.input_weight).as_ptr()),
            gates: Shared::new(&mut state.gates),
            cell: Source(state.cell.as_ptr()),
            tanh_cell: Source(state.tanh_cell.as_ptr()),
            d_hidden: Shared::new(&mut state.d_hidden),
            d_cell: Shared::new(&mut state.d_cell),
            d_last: (d_last, stride),
            d_input: d_input.map(Shared::new),
        };
        compute.split(rows, ROW_GRAIN, self.operations(steps, rows), &|part| {
            // SAFETY: sizes checked above; parts are disjoint rows of every buffer that is written.
            unsafe { back.through_time(part) }
        });
        if let Some(gradients) = gradients {
            self.backward_weights(compute, input, state, gradients);
        }
    }
}

const ROW_GRAIN: usize = 8;
