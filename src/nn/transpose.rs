//! The transposed copy of a matrix, for the product that carries gradients back.

use std::ops::Range;

use super::Real;
use super::layout::{PANEL, Place};
use super::matmul::Shared;
use super::simd::{Kernel, Simd};

/// Copies `panels` of the matrix at `place` from `[panels][inputs][PANEL]` to `[panels of inputs][outputs][PANEL]`.
pub(crate) struct Transpose<'a, T> {
    pub place: Place,
    pub panels: Range<usize>,
    /// All weights of the network.
    pub values: &'a [T],
    /// All transposed copies.
    pub transposed: Shared<'a, T>,
}

impl<T: Real> Kernel<T> for Transpose<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        let place = self.place;
        let source = &self.values[place.offset..place.offset + place.len()];
        for panel in self.panels {
            for input in (0..place.inputs).step_by(S::LANES) {
                for lane in (0..PANEL).step_by(S::LANES) {
                    let from = (panel * place.inputs + input) * PANEL + lane;
                    let row = input / PANEL * place.padded_outputs() + panel * PANEL + lane;
                    let to = place.transposed + row * PANEL + input % PANEL;
                    let count = (place.inputs - input).min(S::LANES);
                    assert!(from + (count - 1) * PANEL + S::LANES <= source.len());
                    // The last element of the tile bounds all others.
                    let target = self.transposed.pointer(to + (S::LANES - 1) * PANEL + S::LANES);
                    // SAFETY: source and target hold the tile, checked just above; nobody else touches the
                    // tiles of this part's panels.
                    unsafe {
                        let target = target.sub((S::LANES - 1) * PANEL + S::LANES);
                        simd.transpose(source.as_ptr().add(from), count, target, PANEL);
                    }
                }
            }
        }
    }
}
