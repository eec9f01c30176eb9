//! One vocabulary of vector operations, so that each kernel is written once and runs with the widest
//! instructions of the machine it finds itself on.
//!
//! A value of an implementing type is proof that its instructions exist: those of [`avx2`] and [`avx512`]
//! are made in this file only, after asking the processor.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;
mod tanh;

use super::Real;
use portable::Portable32;
pub use portable::Portable64;

/// An instruction set that the kernels are compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// 512-bit vectors with fused multiply-add (x86-64 with AVX-512F).
    Avx512,
    /// 256-bit vectors with fused multiply-add (x86-64 with AVX2 and FMA).
    Avx2,
    /// Whatever the compiler's baseline target offers.
    Portable,
}

impl Isa {
    /// The instruction sets this machine runs, widest first; [`Isa::Portable`] always.
    pub fn available() -> impl Iterator<Item = Isa> {
        [Isa::Avx512, Isa::Avx2, Isa::Portable].into_iter().filter(|isa| isa.is_available())
    }

    /// Whether this machine runs it.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 => is_x86_feature_detected!("avx512f") && Isa::Avx2.is_available(),
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            Isa::Portable => true,
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }
}

/// Asks for the cache line at `address`, which will be read soon; any address will do.
#[inline(always)]
pub fn prefetch<T>(address: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: part of the baseline; a prefetch never faults.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(address.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Vectors of [`Simd::LANES`] numbers and what can be done with them.
pub trait Simd: Copy {
    /// The number in a lane.
    type Scalar: Real;
    /// A vector.
    type Vector: Copy;
    /// Numbers in a vector.
    const LANES: usize;
    /// Rows of the register tile of a matrix product that is two vectors wide.
    const TILE_ROWS: usize;

    /// The same number in every lane.
    fn splat(self, value: Self::Scalar) -> Self::Vector;

    /// The `LANES` numbers from `source` on.
    ///
    /// # Safety
    /// `source` must be valid for reads of `LANES` numbers.
    unsafe fn load(self, source: *const Self::Scalar) -> Self::Vector;

    /// Writes all lanes.
    ///
    /// # Safety
    /// `target` must be valid for writes of `LANES` numbers.
    unsafe fn store(self, target: *mut Self::Scalar, vector: Self::Vector);

    /// The first `count <= LANES` numbers from `source` on; zero in the other lanes.
    ///
    /// # Safety
    /// `source` must be valid for reads of `count` numbers.
    unsafe fn load_first(self, source: *const Self::Scalar, count: usize) -> Self::Vector;

    /// Writes the first `count <= LANES` lanes.
    ///
    /// # Safety
    /// `target` must be valid for writes of `count` numbers.
    unsafe fn store_first(self, target: *mut Self::Scalar, vector: Self::Vector, count: usize);

    /// `a + b`.
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a - b`.
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a * b`.
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a / b`.
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a * b + c`, rounded once where the hardware fuses.
    fn mul_add(self, a: Self::Vector, b: Self::Vector, c: Self::Vector) -> Self::Vector;
    /// The smaller; `b` where either is not a number.
    fn min(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The larger; `b` where either is not a number.
    fn max(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Square root.
    fn sqrt(self, a: Self::Vector) -> Self::Vector;
    /// `1 / a` within two units in the last place, for `a` of a magnitude from 1 to 1e30; not-a-number stays what it is.
    #[inline(always)]
    fn reciprocal(self, a: Self::Vector) -> Self::Vector {
        self.div(self.splat(Self::Scalar::ONE), a)
    }
    /// `yes` in lanes where `condition > 0`, `no` elsewhere.
    fn if_positive(self, condition: Self::Vector, yes: Self::Vector, no: Self::Vector) -> Self::Vector;
    /// Hyperbolic tangent. In f32 within 5e-7 of the true value, relative; in f64 the standard library's.
    fn tanh(self, a: Self::Vector) -> Self::Vector;

    /// Writes `target[j][i] = source[i][j]` for `i` and `j` below `LANES`, rows `stride` apart in both; source
    /// rows from `count <= LANES` on count as zero.
    ///
    /// # Safety
    /// `source` must be valid for reads of `count` rows and `target` for writes of `LANES` rows.
    #[inline(always)]
    unsafe fn transpose(
        self,
        source: *const Self::Scalar,
        count: usize,
        target: *mut Self::Scalar,
        stride: usize,
    ) {
        for i in 0..Self::LANES {
            for j in 0..Self::LANES {
                // SAFETY: by the caller's contract.
                unsafe {
                    let element = if i < count { *source.add(i * stride + j) } else { Self::Scalar::ZERO };
                    *target.add(j * stride + i) = element;
                }
            }
        }
    }

    /// Logistic function `1 / (1 + exp(-a))`, as `(1 + tanh(a / 2)) / 2`.
    #[inline(always)]
    fn sigmoid(self, a: Self::Vector) -> Self::Vector {
        let half = self.splat(Self::Scalar::from_f64(0.5));
        self.mul_add(half, self.tanh(self.mul(half, a)), half)
    }

    /// The numbers of `source`, `LANES` of them or, at the end of a slice, fewer; zero in the other lanes.
    #[inline(always)]
    fn read(self, source: &[Self::Scalar]) -> Self::Vector {
        if source.len() >= Self::LANES {
            // SAFETY: the slice is long enough.
            unsafe { self.load(source.as_ptr()) }
        } else {
            // SAFETY: the count is the slice's own.
            unsafe { self.load_first(source.as_ptr(), source.len()) }
        }
    }

    /// Fills `target` from the lanes, as many as it holds, `LANES` at most.
    #[inline(always)]
    fn write(self, target: &mut [Self::Scalar], vector: Self::Vector) {
        if target.len() >= Self::LANES {
            // SAFETY: the slice is long enough.
            unsafe { self.store(target.as_mut_ptr(), vector) }
        } else {
            // SAFETY: the count is the slice's own.
            unsafe { self.store_first(target.as_mut_ptr(), vector, target.len()) }
        }
    }
}

/// Work written once over [`Simd`]. Implementations are `#[inline(always)]`, so that they are compiled into a
/// function that has the instructions enabled.
pub trait Kernel<T: Real> {
    /// What the kernel returns.
    type Output;

    /// Does the work with the given vectors.
    fn run<S: Simd<Scalar = T>>(self, simd: S) -> Self::Output;
}

/// Runs a kernel on `f32` with the instructions of `isa`, or portably where the machine lacks them.
#[inline]
pub fn dispatch_f32<K: Kernel<f32>>(isa: Isa, kernel: K) -> K::Output {
    match isa {
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 if isa.is_available() => {
            // SAFETY: the guard asked the processor.
            unsafe { run_avx512(kernel) }
        }
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 if isa.is_available() => {
            // SAFETY: the guard asked the processor.
            unsafe { run_avx2(kernel) }
        }
        _ => kernel.run(Portable32),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2,fma")]
fn run_avx512<K: Kernel<f32>>(kernel: K) -> K::Output {
    // SAFETY: this function is only entered where the instructions exist.
    kernel.run(unsafe { avx512::Avx512::assume() })
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<K: Kernel<f32>>(kernel: K) -> K::Output {
    // SAFETY: this function is only entered where the instructions exist.
    kernel.run(unsafe { avx2::Avx2::assume() })
}
