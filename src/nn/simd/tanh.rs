//! Hyperbolic tangent of `f32` vectors.

use super::Simd;

/// From here on `tanh` rounds to one in f32.
const LIMIT: f32 = 9.02;

/// Coefficients of `x^(2k+1)` above and `x^(2k)` below: a minimax fit of `tanh(x) / x` on `[0, 9.02]` in the
/// relative error (iterated, reweighted linear least squares; 2e-8 in exact arithmetic).
const NUMERATOR: [f32; 5] = [0.999_999_98, 0.133_797_16, 3.494_032_4e-3, 2.058_344_6e-5, 1.331_902_4e-8];
const DENOMINATOR: [f32; 5] = [1.0, 0.467_130_3, 2.587_106_5e-2, 3.283_089e-4, 7.761_999_5e-7];

/// `tanh(a)` within 5e-7 of the true value, relative; not-a-number stays what it is.
#[inline(always)]
pub fn rational<S: Simd<Scalar = f32>>(simd: S, a: S::Vector) -> S::Vector {
    let x = simd.max(simd.splat(-LIMIT), simd.min(simd.splat(LIMIT), a));
    let square = simd.mul(x, x);
    let numerator = simd.mul(x, polynomial(simd, square, NUMERATOR));
    simd.mul(numerator, simd.reciprocal(polynomial(simd, square, DENOMINATOR)))
}

#[inline(always)]
fn polynomial<S: Simd<Scalar = f32>>(simd: S, x: S::Vector, coefficients: [f32; 5]) -> S::Vector {
    let [c0, c1, c2, c3, c4] = coefficients.map(|c| simd.splat(c));
    simd.mul_add(simd.mul_add(simd.mul_add(simd.mul_add(c4, x, c3), x, c2), x, c1), x, c0)
}

#[cfg(test)]
mod tests {
    use crate::nn::Real;
    use crate::nn::simd::{Isa, Kernel, Simd};

    struct Evaluate<'a> {
        inputs: &'a [f32],
        sigmoid: bool,
        outputs: &'a mut [f32],
    }

    impl Kernel<f32> for Evaluate<'_> {
        type Output = ();

        #[inline(always)]
        fn run<S: Simd<Scalar = f32>>(self, simd: S) {
            for (x, y) in self.inputs.chunks(S::LANES).zip(self.outputs.chunks_mut(S::LANES)) {
                let x = simd.read(x);
                simd.write(y, if self.sigmoid { simd.sigmoid(x) } else { simd.tanh(x) });
            }
        }
    }

    fn evaluate(isa: Isa, inputs: &[f32], sigmoid: bool) -> Vec<f32> {
        let mut outputs = vec![0.0; inputs.len()];
        f32::dispatch(isa, Evaluate { inputs, sigmoid, outputs: &mut outputs });
        outputs
    }

    fn inputs() -> Vec<f32> {
        let dense = (-200_000..=200_000).map(|i| i as f32 * 1e-4);
        let tiny = (-30..=0).flat_map(|e| [1.0, -1.0].map(|sign| sign * 10f32.powi(e)));
        let extreme = [0.0, -0.0, f32::MAX, f32::MIN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE];
        dense.chain(tiny).chain(extreme).collect()
    }

    #[test]
    fn tanh_and_sigmoid_keep_their_stated_errors_on_every_instruction_set() {
        let inputs = inputs();
        for isa in Isa::available() {
            for (x, y) in inputs.iter().zip(evaluate(isa, &inputs, false)) {
                let truth = f64::from(*x).tanh();
                assert!(
                    (f64::from(y) - truth).abs() <= 5e-7 * truth.abs() + 1e-37,
                    "{isa:?} tanh({x}) = {y}"
                );
            }
            for (x, y) in inputs.iter().zip(evaluate(isa, &inputs, true)) {
                let truth = 1.0 / (1.0 + (-f64::from(*x)).exp());
                assert!((f64::from(y) - truth).abs() <= 3e-7, "{isa:?} sigmoid({x}) = {y}");
            }
        }
    }

    #[test]
    fn not_a_number_is_not_hidden() {
        for isa in Isa::available() {
            assert!(evaluate(isa, &[f32::NAN; 20], false).iter().all(|y| y.is_nan()), "{isa:?}");
        }
    }
}
