//! Small arrays that the compiler turns into whatever vectors its target has: four lanes of `f32`, and the
//! `f64` twin that tests compare everything else with.

use super::{Simd, tanh};

/// Four `f32` lanes.
#[derive(Clone, Copy)]
pub struct Portable32;

/// Two `f64` lanes.
#[derive(Clone, Copy)]
pub struct Portable64;

macro_rules! portable {
    ($token:ty, $scalar:ty, $lanes:literal, $tanh:expr) => {
        impl Simd for $token {
            type Scalar = $scalar;
            type Vector = [$scalar; $lanes];
            const LANES: usize = $lanes;
            const TILE_ROWS: usize = 4;

            #[inline(always)]
            fn splat(self, value: $scalar) -> Self::Vector {
                [value; $lanes]
            }

            #[inline(always)]
            unsafe fn load(self, source: *const $scalar) -> Self::Vector {
                // SAFETY: by the caller's contract.
                unsafe { source.cast::<Self::Vector>().read_unaligned() }
            }

            #[inline(always)]
            unsafe fn store(self, target: *mut $scalar, vector: Self::Vector) {
                // SAFETY: by the caller's contract.
                unsafe { target.cast::<Self::Vector>().write_unaligned(vector) }
            }

            #[inline(always)]
            unsafe fn load_first(self, source: *const $scalar, count: usize) -> Self::Vector {
                let mut vector = [0.0; $lanes];
                // SAFETY: by the caller's contract.
                vector[..count].copy_from_slice(unsafe { std::slice::from_raw_parts(source, count) });
                vector
            }

            #[inline(always)]
            unsafe fn store_first(self, target: *mut $scalar, vector: Self::Vector, count: usize) {
                // SAFETY: by the caller's contract.
                unsafe { std::slice::from_raw_parts_mut(target, count) }.copy_from_slice(&vector[..count]);
            }

            #[inline(always)]
            fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| a[i] + b[i])
            }

            #[inline(always)]
            fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| a[i] - b[i])
            }

            #[inline(always)]
            fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| a[i] * b[i])
            }

            #[inline(always)]
            fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| a[i] / b[i])
            }

            #[inline(always)]
            fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| a[i] * b[i] + c[i])
            }

            #[inline(always)]
            fn min(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| if a[i] < b[i] { a[i] } else { b[i] })
            }

            #[inline(always)]
            fn max(self, a: Self::Vector, b: Self::Vector) -> Self::Vector {
                std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
            }

            #[inline(always)]
            fn sqrt(self, a: Self::Vector) -> Self::Vector {
                a.map(<$scalar>::sqrt)
            }

            #[inline(always)]
            fn if_positive(
                self,
                condition: Self::Vector,
                yes: Self::Vector,
                no: Self::Vector,
            ) -> Self::Vector {
                std::array::from_fn(|i| if condition[i] > 0.0 { yes[i] } else { no[i] })
            }

            #[inline(always)]
            fn tanh(self, a: Self::Vector) -> Self::Vector {
                $tanh(self, a)
            }
        }
    };
}

portable!(Portable32, f32, 4, tanh::rational);
portable!(Portable64, f64, 2, |_, a: [f64; 2]| a.map(f64::tanh));
