//! Long short-term memory over whole sequences.

use std::ops::Range;

use super::dense::Source;
use super::elementwise::Accumulate;
use super::layout::{PANEL, Place, padded};
use super::lstm_gates::{GATES, GatesBackward, GatesForward};
use super::matmul::{ColumnSums, OuterProduct, Product, Shared, Start, Strides};
use super::{Activation, Buffer, Compute, Gradients, Layout, Parameters, Real};

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
        state.bias.copy_from_slice(parameters.at(self.input_bias));
        let sum = Accumulate { target: &mut state.bias, source: parameters.at(self.hidden_bias) };
        T::dispatch(compute.isa(), sum);

        let isa = compute.isa();
        let pass = Pass {
            layer: self,
            isa,
            input: Source(input.as_ptr()),
            bias: Source(state.bias.as_ptr()),
            input_weight: Source(parameters.at(self.input_weight).as_ptr()),
            hidden_weight: Source(parameters.at(self.hidden_weight).as_ptr()),
            gates: Shared::new(&mut state.gates),
            cell: Shared::new(&mut state.cell),
            tanh_cell: Shared::new(&mut state.tanh_cell),
            hidden: Shared::new(&mut state.hidden_states),
            rows,
        };
        compute.split(rows, ROW_GRAIN, self.operations(steps, rows), &|part| {
            // SAFETY: sizes checked above; parts are disjoint rows of every buffer that is written.
            unsafe {
                pass.project(steps, part.clone());
                for step in 0..steps {
                    pass.step(step, part.clone());
                }
            }
        });
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

    fn backward_weights<T: Real>(
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

const ROW_GRAIN: usize = 8;

/// A forward pass, shared by the threads that compute its rows.
struct Pass<'a, T> {
    layer: &'a Lstm,
    isa: super::Isa,
    input: Source<T>,
    bias: Source<T>,
    input_weight: Source<T>,
    hidden_weight: Source<T>,
    gates: Shared<'a, T>,
    cell: Shared<'a, T>,
    tanh_cell: Shared<'a, T>,
    hidden: Shared<'a, T>,
    rows: usize,
}

impl<T: Real> Pass<'_, T> {
    /// Writes `b + W x` to the gates of all steps: one product over rows x steps.
    unsafe fn project(&self, steps: usize, part: Range<usize>) {
        let (layer, blocks) = (self.layer, self.layer.blocks());
        let product = Product {
            a: self.input.at(part.start * layer.inputs),
            a_strides: Strides::row_major(self.rows, layer.inputs),
            b: self.input_weight.at(0),
            panel_rows: layer.inputs,
            c: self.gates.pointer(part.start * PANEL),
            c_strides: Strides::blocked(self.rows, GATES * blocks),
            steps,
            rows: part.len(),
            inner: layer.inputs,
            columns: GATES * blocks * PANEL,
            start: Start::Bias(self.bias.at(0)),
            activation: Activation::Identity,
        };
        // SAFETY: by the caller's contract.
        unsafe { product.run(self.isa) }
    }

    /// Adds `W h` of the step before, where there is one, and computes the new states, block by block while the
    /// block's four gates are in the first-level cache.
    unsafe fn step(&self, step: usize, part: Range<usize>) {
        let (layer, blocks, rows) = (self.layer, self.layer.blocks(), self.rows);
        let gate_strides = Strides::blocked(rows, GATES * blocks);
        let state_strides = Strides::blocked(rows, blocks);
        let first = part.start * PANEL;
        for block in 0..blocks {
            let state = step * state_strides.step + block * state_strides.panel + first;
            let previous = state.wrapping_sub(state_strides.step);
            let gates = step * gate_strides.step + block * gate_strides.panel + first;
            let gate_stride = blocks * gate_strides.panel;
            if step > 0 {
                for gate in 0..GATES {
                    let product = Product {
                        a: self.hidden.pointer((step - 1) * state_strides.step + first).cast_const(),
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
                previous_cell: (step > 0).then(|| self.cell.pointer(previous).cast_const()),
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

/// A backward pass, shared by the threads that compute its rows.
struct PassBack<'a, T> {
    layer: &'a Lstm,
    isa: super::Isa,
    steps: usize,
    rows: usize,
    lengths: Option<&'a [usize]>,
    hidden_weight: Source<T>,
    input_weight: Source<T>,
    gates: Shared<'a, T>,
    cell: Source<T>,
    tanh_cell: Source<T>,
    d_hidden: Shared<'a, T>,
    d_cell: Shared<'a, T>,
    d_last: (&'a [T], usize),
    d_input: Option<Shared<'a, T>>,
}

impl<T: Real> PassBack<'_, T> {
    unsafe fn through_time(&self, part: Range<usize>) {
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::nn::Isa;
    use crate::nn::testing::{check_inputs, check_weights, random, weighted_sum};

    struct Case {
        layer: Lstm,
        steps: usize,
        rows: usize,
        lengths: Option<Vec<usize>>,
    }

    impl Case {
        fn new(inputs: usize, hidden: usize, steps: usize, rows: usize) -> (Self, Arc<Layout>) {
            let mut layout = Layout::new();
            let layer = Lstm::new(&mut layout, "lstm", inputs, hidden);
            (Self { layer, steps, rows, lengths: None }, Arc::new(layout))
        }

        fn last<T: Real>(
            &self,
            compute: &mut Compute,
            parameters: &Parameters<T>,
            input: &[T],
            state: &mut LstmState<T>,
        ) -> Vec<T> {
            let lengths = self.lengths.as_deref();
            self.layer.forward(compute, parameters, input, self.steps, self.rows, lengths, state);
            let mut last = vec![T::from_f64(f64::NAN); self.rows * self.layer.hidden];
            state.read_last(lengths, &mut last, self.layer.hidden);
            last
        }

        /// Last states, gradients of inputs and of weights, for `sum d_last last`.
        fn everything<T: Real>(
            &self,
            compute: &mut Compute,
            parameters: &Parameters<T>,
            input: &[T],
            d_last: &[T],
        ) -> (Vec<T>, Vec<T>, Gradients<T>) {
            let mut state = self.layer.state(self.steps, self.rows);
            let last = self.last(compute, parameters, input, &mut state);
            let mut d_input = vec![T::from_f64(f64::NAN); input.len()];
            let mut gradients = Gradients::zeros(parameters.layout());
            self.layer.backward(
                compute,
                parameters,
                input,
                self.lengths.as_deref(),
                &mut state,
                (d_last, self.layer.hidden),
                Some(&mut d_input),
                Some(&mut gradients),
            );
            (last, d_input, gradients)
        }
    }

    #[test]
    fn gradients_are_central_differences() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (inputs, hidden, steps, rows) in [(1, 1, 1, 1), (2, 5, 4, 3), (3, 33, 3, 2), (34, 4, 2, 9)] {
            let (mut case, layout) = Case::new(inputs, hidden, steps, rows);
            let parameters = Parameters::initialised(&layout, &mut rng);
            for ragged in [false, true] {
                case.lengths = ragged.then(|| (0..rows).map(|row| row * 2 % (steps + 1)).collect());
                let input = random(&mut rng, steps * rows * inputs);
                let d_last: Vec<f64> = random(&mut rng, rows * hidden);
                let mut compute = Compute::new(1);
                let (_, d_input, gradients) = case.everything(&mut compute, &parameters, &input, &d_last);
                let mut state = case.layer.state(steps, rows);
                check_inputs(&input, &d_input, |input| {
                    weighted_sum(&d_last, &case.last(&mut compute, &parameters, input, &mut state))
                });
                check_weights(&parameters, &gradients, |parameters| {
                    weighted_sum(&d_last, &case.last(&mut compute, parameters, &input, &mut state))
                });
            }
        }
    }

    #[test]
    fn one_step_of_one_unit_is_the_textbook_formula() {
        let (case, layout) = Case::new(1, 1, 2, 1);
        let mut parameters = Parameters::zeros(&layout, false);
        let (weight_x, weight_h) = ([0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]);
        let (bias_x, bias_h) = ([0.01, 0.02, 0.03, 0.04], [0.05, 0.06, 0.07, 0.08]);
        parameters.update(|values| {
            for (tensor, elements) in layout.tensors().iter().zip([weight_x, weight_h, bias_x, bias_h]) {
                layout.scatter(tensor, &elements, values);
            }
        });
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let (mut h, mut c) = (0.0, 0.0);
        for x in [1.5, -0.5] {
            let sum = |k: usize| weight_x[k] * x + weight_h[k] * h + bias_x[k] + bias_h[k];
            c = sigmoid(sum(1)) * c + sigmoid(sum(0)) * sum(2).tanh();
            h = sigmoid(sum(3)) * c.tanh();
        }
        let mut state = case.layer.state(2, 1);
        let last = case.last(&mut Compute::new(1), &parameters, &[1.5, -0.5], &mut state);
        assert!((last[0] - h).abs() < 1e-15);
        assert_eq!(state.hidden(1, 0).collect::<Vec<_>>(), last);
    }

    #[test]
    fn what_follows_a_history_and_who_shares_its_batch_do_not_matter() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut case, layout) = Case::new(3, 40, 5, 4);
        let parameters = Parameters::<f32>::initialised(&layout, &mut rng);
        case.lengths = Some(vec![2, 0, 5, 3]);
        let input: Vec<f32> = random(&mut rng, 5 * 4 * 3);
        let mut compute = Compute::new(1);
        let last = case.last(&mut compute, &parameters, &input, &mut case.layer.state(5, 4));
        assert!(last[40..80].iter().all(|&h| h == 0.0), "an empty history leaves zero memory");

        for (row, &length) in [2, 0, 5, 3].iter().enumerate() {
            let (alone, _) = Case::new(3, 40, length, 1);
            let own: Vec<f32> = (0..length)
                .flat_map(|step| input[(step * 4 + row) * 3..(step * 4 + row) * 3 + 3].iter().copied())
                .collect();
            let expected = alone.last(&mut compute, &parameters, &own, &mut alone.layer.state(length, 1));
            assert_eq!(last[row * 40..row * 40 + 40], expected);
        }
    }

    #[test]
    fn instruction_sets_agree_and_threads_do_not_change_a_bit() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for (inputs, hidden, steps, rows) in [(2, 64, 9, 32), (20, 40, 4, 21)] {
            let (mut case, layout) = Case::new(inputs, hidden, steps, rows);
            let parameters = Parameters::<f32>::initialised(&layout, &mut rng);
            let input: Vec<f32> = random(&mut rng, steps * rows * inputs);
            let d_last: Vec<f32> = random(&mut rng, rows * hidden);
            for ragged in [false, true] {
                case.lengths = ragged.then(|| (0..rows).map(|row| row % (steps + 1)).collect());
                let everything = |isa, threads| {
                    let mut compute = Compute::with_isa(isa, threads).unwrap();
                    let (last, d_input, gradients) =
                        case.everything(&mut compute, &parameters, &input, &d_last);
                    [&last, &d_input, gradients.values()].concat()
                };
                let expected = everything(Isa::Portable, 1);
                for isa in Isa::available() {
                    let one = everything(isa, 1);
                    for (a, b) in one.iter().zip(&expected) {
                        assert!((a - b).abs() <= 2e-5, "{isa:?}: {a} against {b}");
                    }
                    for threads in [2, 3] {
                        assert_eq!(everything(isa, threads), one, "{isa:?} on {threads} threads");
                    }
                }
            }
        }
    }
}
