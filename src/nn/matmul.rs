//! The three matrix products of a layer, on register tiles.
//!
//! With `A` the inputs, `C` the outputs and the weights in panels of [`PANEL`] columns:
//! forward `C = A W^T`, backward `dA = dC W` (the same kernel on the transposed copy), and
//! `dW += dC^T A`. Every element of a result is one chain of multiply-adds in the order of the inner index,
//! whatever the tile that computes it: cutting the work differently does not change a bit.

use std::marker::PhantomData;
use std::ops::Range;

use super::layout::PANEL;
use super::simd::{Isa, Kernel, Simd, prefetch};
use super::{Activation, Real};

/// How a batch of vectors lies in memory: element `(row, column)` at
/// `row * self.row + column / PANEL * self.panel + column % PANEL`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strides {
    pub row: usize,
    pub panel: usize,
    /// From one step of a sequence to the next.
    pub step: usize,
}

impl Strides {
    /// `[steps][rows][features]`, of which each product uses the first so many features.
    pub fn row_major(rows: usize, features: usize) -> Self {
        Self { row: features, panel: PANEL, step: rows * features }
    }

    /// `[steps][panels][rows][PANEL]`: what an LSTM keeps its gates and states in. The rows of a tile lie side
    /// by side, where row-major gates, a power of two apart, would fight for the same cache lines.
    pub fn blocked(rows: usize, panels: usize) -> Self {
        Self { row: PANEL, panel: rows * PANEL, step: panels * rows * PANEL }
    }
}

/// A mutable slice that several threads write to, each to elements of its own.
#[derive(Clone, Copy)]
pub(crate) struct Shared<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: access goes through unsafe methods whose callers keep to disjoint elements.
unsafe impl<T: Send> Send for Shared<'_, T> {}
// SAFETY: see above.
unsafe impl<T: Send> Sync for Shared<'_, T> {}

impl<'a, T> Shared<'a, T> {
    pub fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// # Safety
    /// While the result lives, nobody else may write to the range, and nobody may read it if it is written to.
    #[allow(clippy::mut_from_ref)]
    pub unsafe fn range(&self, range: Range<usize>) -> &'a mut [T] {
        assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: inside the slice; exclusive by the caller's word.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start), range.len()) }
    }

    pub fn pointer(&self, offset: usize) -> *mut T {
        assert!(offset <= self.len);
        // SAFETY: inside the slice or one past its end.
        unsafe { self.start.add(offset) }
    }
}

/// What a product is added to.
#[derive(Clone, Copy)]
pub(crate) enum Start<T> {
    Zero,
    /// A bias, padded to whole panels.
    Bias(*const T),
    /// What is already there.
    Result,
}

/// `C = f(start + A B)` for `steps` matrices `A` of `rows x inner` and one matrix `B` of `inner x columns` in
/// panels `[panels][panel_stride][PANEL]`, of which the first `inner` rows of each panel are used.
#[derive(Clone, Copy)]
pub(crate) struct Product<T> {
    pub a: *const T,
    pub a_strides: Strides,
    pub b: *const T,
    pub panel_rows: usize,
    pub c: *mut T,
    pub c_strides: Strides,
    pub steps: usize,
    pub rows: usize,
    pub inner: usize,
    pub columns: usize,
    pub start: Start<T>,
    pub activation: Activation,
}

/// Inner indices that a turn of the innermost loop takes: the addresses of the rows of `A`, worked out on the
/// ports that the multiply-adds need, serve them all.
const AT_ONCE: usize = 4;

impl<T: Real> Product<T> {
    /// Computes the product.
    ///
    /// # Safety
    /// All pointers must be valid for what the sizes and strides make of them, and nobody else may access the
    /// written elements of `c` meanwhile.
    #[inline]
    pub unsafe fn run(self, isa: Isa) {
        T::dispatch(isa, self);
    }

    #[inline(always)]
    fn columns<S: Simd<Scalar = T>, const VECTORS: usize, const FULL: bool>(&self, simd: S, column: usize) {
        for step in 0..self.steps {
            let mut row = 0;
            while row < self.rows {
                let left = self.rows - row;
                row += if S::TILE_ROWS >= 8 && left >= 8 {
                    self.tile::<S, 8, VECTORS, FULL>(simd, step, row, column)
                } else if left >= 4 {
                    self.tile::<S, 4, VECTORS, FULL>(simd, step, row, column)
                } else if left >= 2 {
                    self.tile::<S, 2, VECTORS, FULL>(simd, step, row, column)
                } else {
                    self.tile::<S, 1, VECTORS, FULL>(simd, step, row, column)
                };
            }
        }
    }

    /// One register tile, `ROWS` by `VECTORS * LANES`; returns `ROWS`. Only where it is not `FULL` may columns
    /// be missing from its vectors.
    #[inline(always)]
    fn tile<S: Simd<Scalar = T>, const ROWS: usize, const VECTORS: usize, const FULL: bool>(
        &self,
        simd: S,
        step: usize,
        row: usize,
        column: usize,
    ) -> usize {
        let (panel, lane) = (column / PANEL, column % PANEL);
        let valid = |v: usize| (self.columns - column).saturating_sub(v * S::LANES).min(S::LANES);
        // SAFETY: all offsets stay within what `run`'s caller vouched for: rows below `rows`, columns below
        // `columns` (partial vectors at the edge), inner indices below `inner`. `B` and biases are padded.
        unsafe {
            let c = self.c.add(step * self.c_strides.step + panel * self.c_strides.panel + lane);
            let c = |r: usize, v: usize| c.add((row + r) * self.c_strides.row + v * S::LANES);
            let mut sum = [[simd.splat(T::ZERO); VECTORS]; ROWS];
            match self.start {
                Start::Zero => {}
                Start::Bias(bias) => {
                    for v in 0..VECTORS {
                        let bias = simd.load(bias.add(column + v * S::LANES));
                        for row in &mut sum {
                            row[v] = bias;
                        }
                    }
                }
                Start::Result => {
                    for (r, row) in sum.iter_mut().enumerate() {
                        for (v, sum) in row.iter_mut().enumerate() {
                            *sum = if FULL { simd.load(c(r, v)) } else { simd.load_first(c(r, v), valid(v)) };
                        }
                    }
                }
            }

            let mut a = self.a.add(step * self.a_strides.step + row * self.a_strides.row);
            let mut b = self.b.add(panel * self.panel_rows * PANEL + lane);
            // Together the tiles of this panel ask for the next one.
            let mut ahead = b.wrapping_add((self.panel_rows + row * self.inner / self.rows) * PANEL);
            let ahead_step = AT_ONCE * PANEL * ROWS / self.rows;
            let mut left = self.inner;
            while left > 0 {
                let depth = left.min(PANEL);
                let mut k = 0;
                while k + AT_ONCE <= depth {
                    prefetch(ahead);
                    prefetch(ahead.wrapping_add(PANEL / 2));
                    ahead = ahead.wrapping_add(ahead_step);
                    for next in k..k + AT_ONCE {
                        multiply(simd, a.add(next), self.a_strides.row, b.add(next * PANEL), &mut sum);
                    }
                    k += AT_ONCE;
                }
                while k < depth {
                    multiply(simd, a.add(k), self.a_strides.row, b.add(k * PANEL), &mut sum);
                    k += 1;
                }
                a = a.wrapping_add(self.a_strides.panel);
                b = b.wrapping_add(PANEL * PANEL);
                left -= depth;
            }

            for (r, row) in sum.iter().enumerate() {
                for (v, &sum) in row.iter().enumerate() {
                    if FULL {
                        simd.store(c(r, v), sum);
                    } else {
                        simd.store_first(c(r, v), sum, valid(v));
                    }
                }
            }
            // From memory, in loops: with a long function of the registers the compiler would keep none of them.
            if self.activation != Activation::Identity {
                for r in 0..ROWS {
                    for v in 0..VECTORS {
                        let y = simd.load_first(c(r, v), valid(v));
                        simd.store_first(c(r, v), self.activation.apply(simd, y), valid(v));
                    }
                }
            }
        }
        ROWS
    }
}

/// Adds `a b` to a tile, for one inner index: `a` is a column of `ROWS`, `stride` apart, `b` a row.
///
/// # Safety
/// `a` and `b` must be valid for reads of the tile's height and width.
#[inline(always)]
unsafe fn multiply<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    a: *const S::Scalar,
    stride: usize,
    b: *const S::Scalar,
    tile: &mut [[S::Vector; VECTORS]; ROWS],
) {
    // SAFETY: by the caller's contract.
    unsafe {
        let mut weights = [simd.splat(S::Scalar::ZERO); VECTORS];
        for (v, weights) in weights.iter_mut().enumerate() {
            *weights = simd.load(b.add(v * S::LANES));
        }
        for (r, row) in tile.iter_mut().enumerate() {
            let x = simd.splat(*a.add(r * stride));
            for v in 0..VECTORS {
                row[v] = simd.mul_add(x, weights[v], row[v]);
            }
        }
    }
}

impl<T: Real> Kernel<T> for Product<T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        let mut column = 0;
        while column < self.columns {
            let left = (self.columns - column).min(PANEL - column % PANEL);
            if left >= 2 * S::LANES {
                self.columns::<S, 2, true>(simd, column);
                column += 2 * S::LANES;
            } else if left > S::LANES {
                self.columns::<S, 2, false>(simd, column);
                column += 2 * S::LANES;
            } else if left == S::LANES {
                self.columns::<S, 1, true>(simd, column);
                column += S::LANES;
            } else {
                self.columns::<S, 1, false>(simd, column);
                column += S::LANES;
            }
        }
    }
}

/// `dW += sum over steps of dC^T A` with `dW` in panels `[panels of columns][inner][PANEL]`; only `inner_range`
/// of the inputs and `panels` of the outputs are touched. Every element adds its terms in the order of steps
/// and rows.
#[derive(Clone, Copy)]
pub(crate) struct OuterProduct<T> {
    pub a: *const T,
    pub a_strides: Strides,
    pub dc: *const T,
    pub dc_strides: Strides,
    pub dw: *mut T,
    pub steps: usize,
    pub rows: usize,
    pub inner: usize,
    pub inner_start: usize,
    pub inner_end: usize,
    pub columns: usize,
    pub panel_start: usize,
    pub panel_end: usize,
}

/// Rows of `A` and `dC` that a pass over `dW` takes at once: what stays in the second-level cache.
const ROWS_PER_PASS: usize = 512;

impl<T: Real> OuterProduct<T> {
    /// Computes the product.
    ///
    /// # Safety
    /// As for [`Product::run`], for `dw`.
    #[inline]
    pub unsafe fn run(self, isa: Isa) {
        T::dispatch(isa, self);
    }

    #[inline(always)]
    fn pass<S: Simd<Scalar = T>>(&self, simd: S, steps: Range<usize>, rows: Range<usize>) {
        for panel in self.panel_start..self.panel_end {
            let width = (self.columns - panel * PANEL).min(PANEL);
            let mut lane = 0;
            while lane < width {
                let left = width - lane;
                let pass = (steps.clone(), rows.clone());
                if left >= 2 * S::LANES {
                    self.lanes::<S, 2, true>(simd, pass, panel, lane);
                    lane += 2 * S::LANES;
                } else if left >= S::LANES {
                    self.lanes::<S, 1, true>(simd, pass, panel, lane);
                    lane += S::LANES;
                } else {
                    self.lanes::<S, 1, false>(simd, pass, panel, lane);
                    lane += S::LANES;
                }
            }
        }
    }

    #[inline(always)]
    fn lanes<S: Simd<Scalar = T>, const VECTORS: usize, const FULL: bool>(
        &self,
        simd: S,
        pass: (Range<usize>, Range<usize>),
        panel: usize,
        lane: usize,
    ) {
        let mut k = self.inner_start;
        while k < self.inner_end {
            let left = self.inner_end - k;
            let pass = (pass.0.clone(), pass.1.clone());
            k += if S::TILE_ROWS >= 8 && left >= 8 {
                self.tile::<S, 8, VECTORS, FULL>(simd, pass, panel, lane, k)
            } else if left >= 4 {
                self.tile::<S, 4, VECTORS, FULL>(simd, pass, panel, lane, k)
            } else if left >= 2 {
                self.tile::<S, 2, VECTORS, FULL>(simd, pass, panel, lane, k)
            } else {
                self.tile::<S, 1, VECTORS, FULL>(simd, pass, panel, lane, k)
            };
        }
    }

    /// Adds to `dW[panel][k..k + INPUTS][lane..]`; returns `INPUTS`. `k` is a multiple of the tile's height, so
    /// a tile does not cross from one panel of `A` into the next.
    #[inline(always)]
    fn tile<S: Simd<Scalar = T>, const INPUTS: usize, const VECTORS: usize, const FULL: bool>(
        &self,
        simd: S,
        (steps, rows): (Range<usize>, Range<usize>),
        panel: usize,
        lane: usize,
        k: usize,
    ) -> usize {
        let valid = (self.columns - panel * PANEL - lane).min(S::LANES);
        // SAFETY: all offsets stay within what `run`'s caller vouched for.
        unsafe {
            let dw = self.dw.add((panel * self.inner + k) * PANEL + lane);
            let mut sum = [[simd.splat(T::ZERO); VECTORS]; INPUTS];
            for (i, row) in sum.iter_mut().enumerate() {
                for (v, sum) in row.iter_mut().enumerate() {
                    *sum = simd.load(dw.add(i * PANEL + v * S::LANES));
                }
            }
            for step in steps {
                let a = step * self.a_strides.step + k / PANEL * self.a_strides.panel + k % PANEL;
                let dc = step * self.dc_strides.step + panel * self.dc_strides.panel + lane;
                let (a, dc) = (self.a.add(a), self.dc.add(dc));
                for row in rows.clone() {
                    let (a, dc) = (a.add(row * self.a_strides.row), dc.add(row * self.dc_strides.row));
                    let mut gradient = [simd.splat(T::ZERO); VECTORS];
                    for (v, gradient) in gradient.iter_mut().enumerate() {
                        *gradient =
                            if FULL { simd.load(dc.add(v * S::LANES)) } else { simd.load_first(dc, valid) };
                    }
                    for (i, sum) in sum.iter_mut().enumerate() {
                        let x = simd.splat(*a.add(i));
                        for v in 0..VECTORS {
                            sum[v] = simd.mul_add(x, gradient[v], sum[v]);
                        }
                    }
                }
            }
            for (i, row) in sum.iter().enumerate() {
                for (v, &sum) in row.iter().enumerate() {
                    simd.store(dw.add(i * PANEL + v * S::LANES), sum);
                }
            }
        }
        INPUTS
    }
}

impl<T: Real> Kernel<T> for OuterProduct<T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        let steps_per_pass = (ROWS_PER_PASS / self.rows.max(1)).max(1);
        for first_step in (0..self.steps).step_by(steps_per_pass) {
            let steps = first_step..(first_step + steps_per_pass).min(self.steps);
            for first_row in (0..self.rows).step_by(ROWS_PER_PASS) {
                let rows = first_row..(first_row + ROWS_PER_PASS).min(self.rows);
                self.pass(simd, steps.clone(), rows);
            }
        }
    }
}

/// `db += sum over steps and rows of dC` for the given panels.
#[derive(Clone, Copy)]
pub(crate) struct ColumnSums<T> {
    pub dc: *const T,
    pub dc_strides: Strides,
    pub db: *mut T,
    pub steps: usize,
    pub rows: usize,
    pub columns: usize,
    pub panel_start: usize,
    pub panel_end: usize,
}

impl<T: Real> ColumnSums<T> {
    /// Computes the sums.
    ///
    /// # Safety
    /// As for [`Product::run`], for `db`, which is padded to whole panels.
    #[inline]
    pub unsafe fn run(self, isa: Isa) {
        T::dispatch(isa, self);
    }
}

impl<T: Real> Kernel<T> for ColumnSums<T> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd<Scalar = T>>(self, simd: S) {
        for panel in self.panel_start..self.panel_end {
            let width = (self.columns - panel * PANEL).min(PANEL);
            for lane in (0..width).step_by(S::LANES) {
                let valid = (width - lane).min(S::LANES);
                // SAFETY: all offsets stay within what `run`'s caller vouched for.
                unsafe {
                    let db = self.db.add(panel * PANEL + lane);
                    let dc = self.dc.add(panel * self.dc_strides.panel + lane);
                    let mut sum = simd.load(db);
                    for step in 0..self.steps {
                        let dc = dc.add(step * self.dc_strides.step);
                        for row in 0..self.rows {
                            let dc = dc.add(row * self.dc_strides.row);
                            let gradient =
                                if valid == S::LANES { simd.load(dc) } else { simd.load_first(dc, valid) };
                            sum = simd.add(sum, gradient);
                        }
                    }
                    simd.store(db, sum);
                }
            }
        }
    }
}
