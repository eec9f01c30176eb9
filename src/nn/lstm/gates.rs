//! The element-wise half of an LSTM step, for one block of [`PANEL`] hidden units.

use crate::nn::Real;
use crate::nn::layout::PANEL;
use crate::nn::simd::{Isa, Kernel, Simd};

/// Gates in PyTorch's order.
pub(crate) const GATES: usize = 4;

/// Forward: `i, f, o = sigmoid`, `g = tanh` of the sums already in `gates`; `c = f c' + i g`, `h = o tanh(c)`.
///
/// Every pointer is to `rows` rows of [`PANEL`] elements; `gates` are four such, `gate_stride` apart, overwritten
/// by the activations.
#[derive(Clone, Copy)]
pub(crate) struct GatesForward<T> {
    pub gates: *mut T,
    pub gate_stride: usize,
    /// Cell state of the step before; `None` at the first step, where it is zero.
    pub previous_cell: Option<*const T>,
    pub cell: *mut T,
    pub tanh_cell: *mut T,
    pub hidden: *mut T,
    pub rows: usize,
}

impl<T: Real> GatesForward<T> {
    /// Does the work.
    ///
    /// # Safety
    /// The pointers must be valid for `rows * PANEL` elements and not be accessed by anybody else meanwhile.
    #[inline]
    pub unsafe fn run(self, isa: Isa) {
        T::dispatch(isa, self);
    }
}

impl<T: Real> Kernel<T> for GatesForward<T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        for at in (0..self.rows * PANEL).step_by(S::LANES) {
            // SAFETY: `at + LANES <= rows * PANEL`, since LANES divides PANEL; the rest is `run`'s contract.
            unsafe {
                let gate = |index: usize| self.gates.add(index * self.gate_stride + at);
                let input = simd.sigmoid(simd.load(gate(0)));
                let candidate = simd.tanh(simd.load(gate(2)));
                let output = simd.sigmoid(simd.load(gate(3)));
                let mut cell = simd.mul(input, candidate);
                let forget = simd.sigmoid(simd.load(gate(1)));
                if let Some(previous) = self.previous_cell {
                    cell = simd.mul_add(forget, simd.load(previous.add(at)), cell);
                }
                let tanh_cell = simd.tanh(cell);
                simd.store(gate(0), input);
                simd.store(gate(1), forget);
                simd.store(gate(2), candidate);
                simd.store(gate(3), output);
                simd.store(self.cell.add(at), cell);
                simd.store(self.tanh_cell.add(at), tanh_cell);
                simd.store(self.hidden.add(at), simd.mul(output, tanh_cell));
            }
        }
    }
}

/// Backward: from `d_hidden` and the gradient `d_cell` that came back from the step after, the gradients of the
/// gates' sums (over the activations in `gates`) and of the cell state before (over `d_cell`).
#[derive(Clone, Copy)]
pub(crate) struct GatesBackward<T> {
    pub gates: *mut T,
    pub gate_stride: usize,
    pub previous_cell: Option<*const T>,
    pub tanh_cell: *const T,
    pub d_hidden: *const T,
    pub d_cell: *mut T,
    pub rows: usize,
}

impl<T: Real> GatesBackward<T> {
    /// Does the work.
    ///
    /// # Safety
    /// As for [`GatesForward::run`].
    #[inline]
    pub unsafe fn run(self, isa: Isa) {
        T::dispatch(isa, self);
    }
}

impl<T: Real> Kernel<T> for GatesBackward<T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        let (zero, one) = (simd.splat(T::ZERO), simd.splat(T::ONE));
        // The derivative of a sigmoid of value s is s (1 - s).
        let through_sigmoid = |gradient, s| simd.mul(gradient, simd.mul(s, simd.sub(one, s)));
        let through_tanh = |gradient, t| simd.mul(gradient, simd.sub(one, simd.mul(t, t)));
        for at in (0..self.rows * PANEL).step_by(S::LANES) {
            // SAFETY: as in the forward kernel.
            unsafe {
                let gate = |index: usize| self.gates.add(index * self.gate_stride + at);
                let input = simd.load(gate(0));
                let forget = simd.load(gate(1));
                let candidate = simd.load(gate(2));
                let output = simd.load(gate(3));
                let tanh_cell = simd.load(self.tanh_cell.add(at));
                let d_hidden = simd.load(self.d_hidden.add(at));
                let d_output = simd.mul(d_hidden, tanh_cell);
                let d_cell = simd.load(self.d_cell.add(at));
                let d_cell = simd.add(through_tanh(simd.mul(d_hidden, output), tanh_cell), d_cell);
                let d_forget = match self.previous_cell {
                    Some(previous) => simd.mul(d_cell, simd.load(previous.add(at))),
                    None => zero,
                };
                simd.store(gate(0), through_sigmoid(simd.mul(d_cell, candidate), input));
                simd.store(gate(1), through_sigmoid(d_forget, forget));
                simd.store(gate(2), through_tanh(simd.mul(d_cell, input), candidate));
                simd.store(gate(3), through_sigmoid(d_output, output));
                simd.store(self.d_cell.add(at), simd.mul(d_cell, forget));
            }
        }
    }
}
