//! Sixteen `f32` lanes in 512-bit registers.

use std::arch::x86_64::*;

use super::{Simd, tanh};

/// Proof that AVX-512F, AVX2 and FMA exist.
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Avx512 {
    /// # Safety
    /// The processor must have AVX-512F, AVX2 and FMA.
    #[inline(always)]
    pub unsafe fn assume() -> Self {
        Self(())
    }
}

#[inline(always)]
fn first(count: usize) -> __mmask16 {
    ((1u32 << count) - 1) as __mmask16
}

// SAFETY of every intrinsic below: `self` exists only where its instructions do. Memory operands are valid by
// the contract of the trait's methods.
#[allow(clippy::undocumented_unsafe_blocks)]
impl Simd for Avx512 {
    type Scalar = f32;
    type Vector = __m512;
    const LANES: usize = 16;
    const TILE_ROWS: usize = 8;

    #[inline(always)]
    fn splat(self, value: f32) -> __m512 {
        unsafe { _mm512_set1_ps(value) }
    }

    #[inline(always)]
    unsafe fn load(self, source: *const f32) -> __m512 {
        unsafe { _mm512_loadu_ps(source) }
    }

    #[inline(always)]
    unsafe fn store(self, target: *mut f32, vector: __m512) {
        unsafe { _mm512_storeu_ps(target, vector) }
    }

    #[inline(always)]
    unsafe fn load_first(self, source: *const f32, count: usize) -> __m512 {
        unsafe { _mm512_maskz_loadu_ps(first(count), source) }
    }

    #[inline(always)]
    unsafe fn store_first(self, target: *mut f32, vector: __m512, count: usize) {
        unsafe { _mm512_mask_storeu_ps(target, first(count), vector) }
    }

    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_add_ps(a, b) }
    }

    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    fn mul(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    fn div(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_div_ps(a, b) }
    }

    #[inline(always)]
    fn mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        unsafe { _mm512_fmadd_ps(a, b, c) }
    }

    #[inline(always)]
    fn min(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_min_ps(a, b) }
    }

    #[inline(always)]
    fn max(self, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_max_ps(a, b) }
    }

    #[inline(always)]
    fn sqrt(self, a: __m512) -> __m512 {
        unsafe { _mm512_sqrt_ps(a) }
    }

    // A division of 16 lanes blocks its unit for a dozen cycles; a look-up good to 14 bits and a step of Newton's method
    // take two.
    #[inline(always)]
    fn reciprocal(self, a: __m512) -> __m512 {
        unsafe {
            let x = _mm512_rcp14_ps(a);
            let error = _mm512_fnmadd_ps(a, x, _mm512_set1_ps(1.0));
            _mm512_fmadd_ps(x, error, x)
        }
    }

    #[inline(always)]
    fn if_positive(self, condition: __m512, yes: __m512, no: __m512) -> __m512 {
        unsafe {
            let positive = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(condition, _mm512_setzero_ps());
            _mm512_mask_blend_ps(positive, no, yes)
        }
    }

    #[inline(always)]
    fn tanh(self, a: __m512) -> __m512 {
        tanh::rational(self, a)
    }
    #[inline(always)]
    unsafe fn transpose(self, source: *const f32, count: usize, target: *mut f32, stride: usize) {
        unsafe {
            let mut rows = [_mm512_setzero_ps(); 16];
            for (i, row) in rows.iter_mut().enumerate().take(count) {
                *row = _mm512_loadu_ps(source.add(i * stride));
            }
            for (j, column) in transposed(rows).into_iter().enumerate() {
                _mm512_storeu_ps(target.add(j * stride), column);
            }
        }
    }
}

/// Transposes 16 x 16: first within the 128-bit lanes, then the lanes.
///
/// # Safety
/// AVX-512F must exist.
#[inline(always)]
unsafe fn transposed(rows: [__m512; 16]) -> [__m512; 16] {
    let mut pairs = rows;
    let mut quads = rows;
    let mut halves = rows;
    let mut columns = rows;
    // SAFETY: by the caller's contract.
    unsafe {
        for i in (0..16).step_by(2) {
            pairs[i] = _mm512_unpacklo_ps(rows[i], rows[i + 1]);
            pairs[i + 1] = _mm512_unpackhi_ps(rows[i], rows[i + 1]);
        }
        for i in (0..16).step_by(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|j| _mm512_castps_pd(pairs[i + j]));
            quads[i] = _mm512_castpd_ps(_mm512_unpacklo_pd(a, c));
            quads[i + 1] = _mm512_castpd_ps(_mm512_unpackhi_pd(a, c));
            quads[i + 2] = _mm512_castpd_ps(_mm512_unpacklo_pd(b, d));
            quads[i + 3] = _mm512_castpd_ps(_mm512_unpackhi_pd(b, d));
        }
        // Lane l of quads[4 g + j] holds column 4 l + j of rows 4 g to 4 g + 3.
        for j in 0..4 {
            for half in [0, 8] {
                halves[half + j] = _mm512_shuffle_f32x4::<0x88>(quads[half + j], quads[half + 4 + j]);
                halves[half + 4 + j] = _mm512_shuffle_f32x4::<0xdd>(quads[half + j], quads[half + 4 + j]);
            }
        }
        for j in 0..8 {
            columns[j] = _mm512_shuffle_f32x4::<0x88>(halves[j], halves[8 + j]);
            columns[8 + j] = _mm512_shuffle_f32x4::<0xdd>(halves[j], halves[8 + j]);
        }
    }
    columns
}
