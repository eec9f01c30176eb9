//! Kernels that walk one or more slices element by element.

use super::simd::{Kernel, Simd};
use super::{Activation, Real};

/// `target += source`.
pub(crate) struct Accumulate<'a, T> {
    pub target: &'a mut [T],
    pub source: &'a [T],
}

impl<T: Real> Kernel<T> for Accumulate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        for (x, y) in self.target.chunks_mut(S::LANES).zip(self.source.chunks(S::LANES)) {
            simd.write(x, simd.add(simd.read(x), simd.read(y)));
        }
    }
}

/// `target += rate (source - target)`.
pub(crate) struct Blend<'a, T> {
    pub target: &'a mut [T],
    pub source: &'a [T],
    pub rate: T,
}

impl<T: Real> Kernel<T> for Blend<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        let rate = simd.splat(self.rate);
        for (x, y) in self.target.chunks_mut(S::LANES).zip(self.source.chunks(S::LANES)) {
            let target = simd.read(x);
            simd.write(x, simd.mul_add(rate, simd.sub(simd.read(y), target), target));
        }
    }
}

/// Turns the gradient with respect to the outputs of an activation into that with respect to its inputs.
pub(crate) struct PullBack<'a, T> {
    pub activation: Activation,
    pub outputs: &'a [T],
    pub gradient: &'a mut [T],
}

impl<T: Real> Kernel<T> for PullBack<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        for (g, y) in self.gradient.chunks_mut(S::LANES).zip(self.outputs.chunks(S::LANES)) {
            let gradient = self.activation.pull_back(simd, simd.read(y), simd.read(g));
            simd.write(g, gradient);
        }
    }
}
