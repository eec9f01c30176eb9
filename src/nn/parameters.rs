//! The weights of a network and their gradients, as flat vectors.

use std::sync::Arc;

use rand::{Rng, RngExt};

use super::elementwise::{Accumulate, Blend};
use super::layout::{PANEL, Place, padded};
use super::{Buffer, Compute, Layout, Real};

/// The weights of one network.
///
/// Products that carry gradients back need the matrices transposed; those copies are made once per
/// [`update`](Self::update), not once per product.
#[derive(Debug, Clone)]
pub struct Parameters<T> {
    layout: Arc<Layout>,
    values: Buffer<T>,
    transposed: Option<Buffer<T>>,
}

impl<T: Real> Parameters<T> {
    /// All zero. `trainable` weights can be differentiated; others (target networks, policies that only act)
    /// save the transposed copies.
    pub fn zeros(layout: &Arc<Layout>, trainable: bool) -> Self {
        Self {
            layout: Arc::clone(layout),
            values: Buffer::zeros(layout.len()),
            transposed: trainable.then(|| Buffer::zeros(layout.transposed_len())),
        }
    }

    /// PyTorch's default initialisation, trainable: uniform within `1 / sqrt(inputs)` for dense layers and
    /// within `1 / sqrt(hidden)` for all tensors of an LSTM, drawn tensor by tensor in row-major order.
    pub fn initialised(layout: &Arc<Layout>, rng: &mut impl Rng) -> Self {
        let mut parameters = Self::zeros(layout, true);
        parameters.update(|values| {
            for tensor in layout.tensors() {
                let bound = tensor.bound();
                for position in tensor.positions() {
                    values[position] = T::from_f64(rng.random_range(-bound..bound));
                }
            }
        });
        parameters
    }

    /// A copy that cannot be differentiated, for a target network or a policy.
    pub fn frozen(&self) -> Self {
        Self { layout: Arc::clone(&self.layout), values: self.values.clone(), transposed: None }
    }

    /// The table of tensors.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// The flat vector, in the order of [`layout`](Self::layout).
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// Changes the flat vector and brings the transposed copies up to date.
    pub fn update<R>(&mut self, change: impl FnOnce(&mut [T]) -> R) -> R {
        let result = change(&mut self.values);
        if let Some(transposed) = &mut self.transposed {
            for place in self.layout.matrices() {
                transpose(&self.values, transposed, place, 0..place.padded_outputs() / PANEL);
            }
        }
        result
    }

    /// Copies all weights of `other`, which must have an equal layout.
    pub fn copy_from(&mut self, other: &Self) {
        assert_eq!(self.layout, other.layout);
        self.update(|values| values.copy_from_slice(&other.values));
    }

    /// `self += rate (other - self)`: a target network follows (`polyak = 1 - rate`).
    pub fn follow(&mut self, compute: &mut Compute, other: &Self, rate: f64) {
        assert_eq!(self.values.len(), other.values.len());
        let isa = compute.isa();
        self.update(|values| {
            T::dispatch(isa, Blend { target: values, source: &other.values, rate: T::from_f64(rate) });
        });
    }

    /// The elements of a tensor in PyTorch's order; `None` if there is none of that name.
    pub fn tensor(&self, name: &str) -> Option<Vec<T>> {
        let tensor = self.layout.tensors().iter().find(|t| t.name() == name)?;
        Some(self.layout.gather(tensor, &self.values))
    }

    pub(crate) fn at(&self, place: Place) -> &[T] {
        &self.values[place.offset..place.offset + place.len()]
    }

    pub(crate) fn transposed_at(&self, place: Place) -> &[T] {
        let transposed =
            self.transposed.as_ref().expect("weights that are differentiated are made trainable");
        &transposed[place.transposed..place.transposed + place.transposed_len()]
    }
}

/// Gradients of a loss with respect to the weights of one network, in the same layout.
#[derive(Debug, Clone)]
pub struct Gradients<T> {
    layout: Arc<Layout>,
    values: Buffer<T>,
}

impl<T: Real> Gradients<T> {
    /// All zero.
    pub fn zeros(layout: &Arc<Layout>) -> Self {
        Self { layout: Arc::clone(layout), values: Buffer::zeros(layout.len()) }
    }

    /// Sets all to zero; `backward` adds.
    pub fn clear(&mut self) {
        self.values.fill(T::ZERO);
    }

    /// Adds the gradients of another loss.
    pub fn add(&mut self, compute: &mut Compute, other: &Self) {
        assert_eq!(self.values.len(), other.values.len());
        T::dispatch(compute.isa(), Accumulate { target: &mut self.values, source: &other.values });
    }

    /// The table of tensors.
    pub fn layout(&self) -> &Arc<Layout> {
        &self.layout
    }

    /// The flat vector, in the order of [`layout`](Self::layout).
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The flat vector, to be changed (clipped, scaled).
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The elements of a tensor in PyTorch's order; `None` if there is none of that name.
    pub fn tensor(&self, name: &str) -> Option<Vec<T>> {
        let tensor = self.layout.tensors().iter().find(|t| t.name() == name)?;
        Some(self.layout.gather(tensor, &self.values))
    }

    pub(crate) fn at_mut(&mut self, place: Place) -> &mut [T] {
        &mut self.values[place.offset..place.offset + place.len()]
    }
}

/// Copies the given panels of a matrix, block by block of 32 x 32, into its transposed copy.
fn transpose<T: Real>(values: &[T], transposed: &mut [T], place: Place, panels: std::ops::Range<usize>) {
    let source = &values[place.offset..place.offset + place.len()];
    let target = &mut transposed[place.transposed..place.transposed + place.transposed_len()];
    let outputs = place.padded_outputs();
    for panel in panels {
        for block in 0..padded(place.inputs) / PANEL {
            let width = (place.inputs - block * PANEL).min(PANEL);
            let from = (panel * place.inputs + block * PANEL) * PANEL;
            let to = (block * outputs + panel * PANEL) * PANEL;
            let source = &source[from..from + width * PANEL];
            let target = &mut target[to..to + PANEL * PANEL];
            for (output, row) in target.chunks_exact_mut(PANEL).enumerate() {
                for (input, element) in row[..width].iter_mut().enumerate() {
                    *element = source[input * PANEL + output];
                }
            }
        }
    }
}
