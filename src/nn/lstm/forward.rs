//! The LSTM's forward pass: one product projects the inputs of all steps, then step follows step.

use std::ops::Range;

use super::Lstm;
use super::gates::{GATES, GatesForward};
use crate::nn::dense::Source;
use crate::nn::layout::PANEL;
use crate::nn::matmul::{Product, Shared, Start, Strides};
use crate::nn::{Activation, Isa, Real};

/// A forward pass, shared by the threads that compute its rows.
pub(super) struct Pass<'a, T> {
    pub layer: &'a Lstm,
    pub isa: Isa,
    pub input: Source<T>,
    pub bias: Source<T>,
    pub input_weight: Source<T>,
    pub hidden_weight: Source<T>,
    pub gates: Shared<'a, T>,
    pub cell: Shared<'a, T>,
    pub tanh_cell: Shared<'a, T>,
    pub hidden: Shared<'a, T>,
    pub rows: usize,
}

impl<T: Real> Pass<'_, T> {
    /// Writes `b + W x` to the gates of some steps: one product over rows x steps.
    pub unsafe fn project(&self, steps: Range<usize>, part: Range<usize>) {
        let (layer, blocks) = (self.layer, self.layer.blocks());
        let a_strides = Strides::row_major(self.rows, layer.inputs);
        let c_strides = Strides::blocked(self.rows, GATES * blocks);
        let product = Product {
            a: self.input.at(steps.start * a_strides.step + part.start * layer.inputs),
            a_strides,
            b: self.input_weight.at(0),
            panel_rows: layer.inputs,
            c: self.gates.pointer(steps.start * c_strides.step + part.start * PANEL),
            c_strides,
            steps: steps.len(),
            rows: part.len(),
            inner: layer.inputs,
            columns: GATES * blocks * PANEL,
            start: Start::Bias(self.bias.at(0)),
            activation: Activation::Identity,
        };
        // SAFETY: by the caller's contract.
        unsafe { product.run(self.isa) }
    }

    /// Adds `W h` of the `previous` step, where there is one, and computes the new states, block by block while the
    /// block's four gates are in the first-level cache.
    pub unsafe fn step(&self, step: usize, previous: Option<usize>, part: Range<usize>) {
        let (layer, blocks, rows) = (self.layer, self.layer.blocks(), self.rows);
        let gate_strides = Strides::blocked(rows, GATES * blocks);
        let state_strides = Strides::blocked(rows, blocks);
        let first = part.start * PANEL;
        for block in 0..blocks {
            let state_of = |step| step * state_strides.step + block * state_strides.panel + first;
            let state = state_of(step);
            let gates = step * gate_strides.step + block * gate_strides.panel + first;
            let gate_stride = blocks * gate_strides.panel;
            if let Some(previous) = previous {
                for gate in 0..GATES {
                    let product = Product {
                        a: self.hidden.pointer(previous * state_strides.step + first).cast_const(),
                        a_strides: state_strides,
                        b: self.hidden_weight.at((gate * blocks + block) * layer.hidden * PANEL),
                        panel_rows: layer.hidden,
                        c: self.gates.pointer(gates + gate * gate_stride),
                        c_strides: gate_strides,
                        steps: 1,
                        rows: part.len(),
                        inner: layer.hidden,
                        columns: PANEL,
                        start: Start::Result,
                        activation: Activation::Identity,
                    };
                    // SAFETY: by the caller's contract.
                    unsafe { product.run(self.isa) }
                }
            }
            let work = GatesForward {
                gates: self.gates.pointer(gates),
                gate_stride,
                previous_cell: previous.map(|step| self.cell.pointer(state_of(step)).cast_const()),
                cell: self.cell.pointer(state),
                tanh_cell: self.tanh_cell.pointer(state),
                hidden: self.hidden.pointer(state),
                rows: part.len(),
            };
            // SAFETY: by the caller's contract.
            unsafe { work.run(self.isa) }
        }
    }
}
