//! The LSTM's backward pass: gradients go back through time, then on to the inputs and the weights.

use std::ops::Range;

use super::gates::{GATES, GatesBackward};
use super::{Lstm, LstmState};
use crate::nn::dense::Source;
use crate::nn::layout::PANEL;
use crate::nn::matmul::{ColumnSums, OuterProduct, Product, Shared, Start, Strides};
use crate::nn::{Activation, Compute, Gradients, Isa, Real};

/// A backward pass, shared by the threads that compute its rows.
pub(super) struct PassBack<'a, T> {
    pub layer: &'a Lstm,
    pub isa: Isa,
    pub steps: usize,
    pub rows: usize,
    pub lengths: Option<&'a [usize]>,
    pub hidden_weight: Source<T>,
    pub input_weight: Source<T>,
    pub gates: Shared<'a, T>,
    pub cell: Source<T>,
    pub tanh_cell: Source<T>,
    pub d_hidden: Shared<'a, T>,
    pub d_cell: Shared<'a, T>,
    pub d_last: (&'a [T], usize),
    pub d_input: Option<Shared<'a, T>>,
}

impl<T: Real> PassBack<'_, T> {
    pub unsafe fn through_time(&self, part: Range<usize>) {
        let blocks = self.layer.blocks();
        let state_strides = Strides::blocked(self.rows, blocks);
        // SAFETY: the rows of this part, in every block; by the caller's contract nobody else touches them.
        unsafe {
            for block in 0..blocks {
                let at = block * state_strides.panel;
                let rows = at + part.start * PANEL..at + part.end * PANEL;
                self.d_hidden.range(rows.clone()).fill(T::ZERO);
                self.d_cell.range(rows).fill(T::ZERO);
            }
            for step in (0..self.steps).rev() {
                self.receive(step, part.clone());
                self.step(step, part.clone());
            }
            if let Some(d_input) = &self.d_input {
                let inputs = self.layer.inputs;
                let c = d_input.pointer(part.start * inputs);
                let strides = Strides::row_major(self.rows, inputs);
                self.product((0, self.steps), part, &self.input_weight, c, strides, inputs);
            }
        }
    }

    /// Adds the loss's own gradient to the rows whose last valid step this is.
    unsafe fn receive(&self, step: usize, part: Range<usize>) {
        let hidden = self.layer.hidden;
        for row in part {
            if self.lengths.map_or(self.steps, |lengths| lengths[row]) != step + 1 {
                continue;
            }
            let (gradient, stride) = self.d_last;
            let gradient = &gradient[row * stride..row * stride + hidden];
            for (block, gradient) in gradient.chunks(PANEL).enumerate() {
                let at = (block * self.rows + row) * PANEL;
                // SAFETY: a row of this part.
                let target = unsafe { self.d_hidden.range(at..at + gradient.len()) };
                for (target, &gradient) in target.iter_mut().zip(gradient) {
                    *target += gradient;
                }
            }
        }
    }

    unsafe fn step(&self, step: usize, part: Range<usize>) {
        let blocks = self.layer.blocks();
        let gate_strides = Strides::blocked(self.rows, GATES * blocks);
        let state_strides = Strides::blocked(self.rows, blocks);
        for block in 0..blocks {
            let within = block * state_strides.panel + part.start * PANEL;
            let state = step * state_strides.step + within;
            let work = GatesBackward {
                gates: self.gates.pointer(step * gate_strides.step + within),
                gate_stride: blocks * gate_strides.panel,
                previous_cell: (step > 0).then(|| self.cell.at(state - state_strides.step)),
                tanh_cell: self.tanh_cell.at(state),
                d_hidden: self.d_hidden.pointer(within).cast_const(),
                d_cell: self.d_cell.pointer(within),
                rows: part.len(),
            };
            // SAFETY: by the caller's contract.
            unsafe { work.run(self.isa) }
        }
        if step > 0 {
            let c = self.d_hidden.pointer(part.start * PANEL);
            // SAFETY: by the caller's contract.
            unsafe { self.product((step, 1), part, &self.hidden_weight, c, state_strides, blocks * PANEL) }
        }
    }

    /// `c = dgates W` for `steps` steps from `step` on.
    unsafe fn product(
        &self,
        (step, steps): (usize, usize),
        part: Range<usize>,
        weight: &Source<T>,
        c: *mut T,
        c_strides: Strides,
        columns: usize,
    ) {
        let blocks = self.layer.blocks();
        let gate_strides = Strides::blocked(self.rows, GATES * blocks);
        let product = Product {
            a: self.gates.pointer(step * gate_strides.step + part.start * PANEL).cast_const(),
            a_strides: gate_strides,
            b: weight.at(0),
            panel_rows: GATES * blocks * PANEL,
            c,
            c_strides,
            steps,
            rows: part.len(),
            inner: GATES * blocks * PANEL,
            columns,
            start: Start::Zero,
            activation: Activation::Identity,
        };
        // SAFETY: by the caller's contract.
        unsafe { product.run(self.isa) }
    }
}

impl Lstm {
    /// Adds the gradients of the weights, once those of the gates' sums stand in `state`.
    pub(super) fn backward_weights<T: Real>(
        &self,
        compute: &mut Compute,
        input: &[T],
        state: &LstmState<T>,
        gradients: &mut Gradients<T>,
    ) {
        let (steps, rows, isa) = (state.steps, state.rows, compute.isa());
        let columns = GATES * state.blocks * PANEL;
        let dc_strides = Strides::blocked(rows, GATES * state.blocks);
        let a_strides = Strides::blocked(rows, state.blocks);
        let (input, hidden) = (Source(input.as_ptr()), Source(state.hidden_states.as_ptr()));
        let d_gates = Source(state.gates.as_ptr());
        let all = Shared::new(gradients.values_mut());
        let [dw_input, dw_hidden, db_input, db_hidden] =
            [self.input_weight, self.hidden_weight, self.input_bias, self.hidden_bias].map(|p| p.offset);
        compute.split(columns / PANEL, 1, self.operations(steps, rows), &|panels| {
            let (panel_start, panel_end) = (panels.start, panels.end);
            let outer = OuterProduct {
                a: hidden.at(0),
                a_strides,
                // The gates of a step meet the hidden state of the step before.
                dc: d_gates.at(dc_strides.step),
                dc_strides,
                dw: all.pointer(dw_hidden),
                steps: steps.saturating_sub(1),
                rows,
                inner: self.hidden,
                inner_start: 0,
                inner_end: self.hidden,
                columns,
                panel_start,
                panel_end,
            };
            let outer_input = OuterProduct {
                a: input.at(0),
                a_strides: Strides::row_major(rows, self.inputs),
                dc: d_gates.at(0),
                dw: all.pointer(dw_input),
                steps,
                inner: self.inputs,
                inner_end: self.inputs,
                ..outer
            };
            let sums = |offset| ColumnSums {
                dc: d_gates.at(0),
                dc_strides,
                db: all.pointer(offset),
                steps,
                rows,
                columns,
                panel_start,
                panel_end,
            };
            // SAFETY: all buffers hold `steps * rows`; parts are disjoint panels of the gradients.
            unsafe {
                outer.run(isa);
                outer_input.run(isa);
                sums(db_input).run(isa);
                sums(db_hidden).run(isa);
            }
        });
    }
}
