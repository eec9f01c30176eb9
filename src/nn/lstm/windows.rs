//! An LSTM over overlapping windows of a sequence, all of them advanced at once.
//!
//! A forecast that is rolled out starts from zero states for every call and reads the latest inputs, its own forecasts
//! among them. An input is shared by all the windows that reach over it: as soon as it is known they take it in one
//! product, where window by window it would be taken in many small ones. The states are the same bits.

use std::ops::Range;

use super::{Lstm, LstmState, PANEL, ROW_GRAIN};
use crate::nn::{Buffer, Compute, Parameters, Real};

/// Windows of `length` inputs, each beginning `stride` inputs after the one before, over a batch of sequences.
///
/// Window `w` has the slot `w % slots`; there are as many slots as windows reach over one input.
#[derive(Debug, Clone)]
pub struct LstmWindows<T> {
    length: usize,
    stride: usize,
    slots: usize,
    rows: usize,
    capacity: usize,
    /// Windows wanted.
    count: usize,
    /// Inputs taken.
    taken: usize,
    /// `[2][slots][rows][inputs]`: every window has its own copy.
    inputs: Buffer<T>,
    /// Two steps, the present one and the one before, of `[slots][rows]` rows.
    state: LstmState<T>,
}

impl<T: Real> LstmWindows<T> {
    /// Windows that reach over the next input and have taken one before.
    fn under_way(&self) -> Range<usize> {
        let first = (self.taken + 1).saturating_sub(self.length).div_ceil(self.stride);
        first..self.taken.div_ceil(self.stride).min(self.count)
    }

    /// The window that the next input begins.
    fn begun(&self) -> Option<usize> {
        let window = self.taken / self.stride;
        (self.taken.is_multiple_of(self.stride) && window < self.count).then_some(window)
    }

    /// The window that the last input completed.
    fn complete(&self) -> Option<usize> {
        let since_first = self.taken.checked_sub(self.length)?;
        let window = since_first / self.stride;
        (since_first.is_multiple_of(self.stride) && window < self.count).then_some(window)
    }

    /// The rows of `slots[range]`.
    fn rows_of(&self, slots: Range<usize>) -> Range<usize> {
        slots.start * self.rows..slots.end * self.rows
    }

    /// Copies the last hidden states of the window that the last input completed into `output[row * stride..]`; false
    /// where it completed none.
    pub fn read_complete(&self, output: &mut [T], stride: usize) -> bool {
        let Some(window) = self.complete() else { return false };
        let LstmState { blocks, hidden, hidden_states, .. } = &self.state;
        let (all, first) = (self.slots * self.rows, window % self.slots * self.rows);
        let step = (self.taken - 1) % 2;
        for (row, output) in output.chunks_mut(stride).take(self.rows).enumerate() {
            for (block, output) in output[..*hidden].chunks_mut(PANEL).enumerate() {
                let from = ((step * blocks + block) * all + first + row) * PANEL;
                output.copy_from_slice(&hidden_states[from..from + output.len()]);
            }
        }
        true
    }
}

impl Lstm {
    /// Buffers for windows of `length` inputs, `stride` apart, over up to `rows` sequences.
    ///
    /// # Panics
    ///
    /// When the length or the stride is zero.
    pub fn windows<T: Real>(&self, length: usize, stride: usize, rows: usize) -> LstmWindows<T> {
        assert!(length > 0 && stride > 0, "windows of {length} inputs, {stride} apart");
        let slots = length.div_ceil(stride);
        LstmWindows {
            length,
            stride,
            slots,
            rows: 0,
            capacity: rows,
            count: 0,
            taken: 0,
            inputs: Buffer::zeros(2 * slots * rows * self.inputs),
            state: self.state(2, slots * rows),
        }
    }

    /// Starts over: `count` windows over `rows` sequences.
    pub fn begin<T: Real>(
        &self,
        compute: &Compute,
        parameters: &Parameters<T>,
        (count, rows): (usize, usize),
        windows: &mut LstmWindows<T>,
    ) {
        assert!(rows <= windows.capacity);
        (windows.count, windows.rows, windows.taken) = (count, rows, 0);
        (windows.state.steps, windows.state.rows) = (2, windows.slots * rows);
        self.sum_biases(compute, parameters, &mut windows.state);
    }

    /// Takes the next input of every sequence, `[rows][inputs]`, into all windows that reach over it.
    pub fn slide<T: Real>(
        &self,
        compute: &mut Compute,
        parameters: &Parameters<T>,
        input: &[T],
        windows: &mut LstmWindows<T>,
    ) {
        let size = windows.rows * self.inputs;
        let now = windows.taken % 2;
        let under_way = windows.under_way();
        let first = under_way.start % windows.slots;
        let (end, wrapped) = match first + under_way.len() {
            end if end <= windows.slots => (end, 0),
            end => (windows.slots, end - windows.slots),
        };
        let begun = windows.begun().map_or(0..0, |window| {
            let slot = window % windows.slots;
            slot..slot + 1
        });
        let groups = [(first..end, Some(1 - now)), (0..wrapped, Some(1 - now)), (begun, None)];
        for slot in groups.iter().flat_map(|(slots, _)| slots.clone()) {
            let at = (now * windows.slots + slot) * size;
            windows.inputs[at..at + size].copy_from_slice(&input[..size]);
        }
        let groups = groups.map(|(slots, previous)| (windows.rows_of(slots), previous));
        let pass = self.pass(compute, parameters, &windows.inputs, &mut windows.state);
        for (rows, previous) in groups {
            let operations = self.operations(2, rows.len());
            compute.split(rows.len(), ROW_GRAIN, operations, &|part| {
                let part = rows.start + part.start..rows.start + part.end;
                // SAFETY: `begin` checked the sizes; groups and parts are disjoint rows of every buffer that is written.
                unsafe {
                    pass.project(now..now + 1, part.clone());
                    pass.step(now, previous, part);
                }
            });
        }
        windows.taken += 1;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::nn::testing::random;
    use crate::nn::{Isa, Layout};

    #[test]
    fn windows_leave_the_bits_of_runs_of_their_own() {
        let (inputs, hidden) = (2, 40);
        let mut layout = Layout::new();
        let layer = Lstm::new(&mut layout, "lstm", inputs, hidden);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let parameters = Parameters::<f32>::initialised(&Arc::new(layout), &mut rng);
        for (length, stride, count, threads) in
            [(9, 1, 30, 1), (9, 1, 30, 2), (7, 3, 9, 1), (4, 6, 5, 1), (1, 1, 3, 1)]
        {
            let mut windows = layer.windows(length, stride, 12);
            for rows in [12, 5] {
                let total = length + (count - 1) * stride;
                let sequence: Vec<f32> = random(&mut rng, total * rows * inputs);
                for isa in Isa::available() {
                    let mut compute = Compute::with_isa(isa, threads).unwrap();
                    layer.begin(&compute, &parameters, (count, rows), &mut windows);
                    let mut state = layer.state(length, rows);
                    let mut completed = 0;
                    for input in sequence.chunks(rows * inputs) {
                        layer.slide(&mut compute, &parameters, input, &mut windows);
                        let mut last = vec![0.0; rows * hidden];
                        if windows.read_complete(&mut last, hidden) {
                            let own = &sequence[completed * stride * rows * inputs..];
                            let single = &mut Compute::with_isa(isa, 1).unwrap();
                            layer.forward(single, &parameters, own, length, rows, None, &mut state);
                            let mut expected = vec![1.0; rows * hidden];
                            state.read_last(None, &mut expected, hidden);
                            assert_eq!(last, expected, "{isa:?} window {completed} of {length}/{stride}");
                            completed += 1;
                        }
                    }
                    assert_eq!(completed, count, "{length}/{stride}");
                }
            }
        }
    }
}
