//! The weights of a network and their gradients, as flat vectors.

use std::sync::Arc;

use rand::{Rng, RngExt};

use super::elementwise::{Accumulate, Blend};
use super::layout::{PANEL, Place};
use super::matmul::Shared;
use super::transpose::Transpose;
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
        self.update_with(&mut Compute::new(1), |_, values| change(values))
    }

    /// The same on the given threads.
    pub fn update_with<R>(
        &mut self,
        compute: &mut Compute,
        change: impl FnOnce(&mut Compute, &mut [T]) -> R,
    ) -> R {
        let result = change(compute, &mut self.values);
        if let Some(transposed) = &mut self.transposed {
            let isa = compute.isa();
            let (values, transposed) = (&self.values[..], Shared::new(transposed));
            for place in self.layout.matrices() {
                compute.split(place.padded_outputs() / PANEL, 1, place.len(), &|panels| {
                    T::dispatch(isa, Transpose { place, panels, values, transposed });
                });
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
        let rate = T::from_f64(rate);
        self.update_with(compute, |compute, values| {
            let (isa, count, values) = (compute.isa(), values.len(), Shared::new(values));
            compute.split(count, PANEL, count, &|part| {
                // SAFETY: parts are disjoint.
                let target = unsafe { values.range(part.clone()) };
                T::dispatch(isa, Blend { target, source: &other.values[part], rate });
            });
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

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::nn::layout::padded;
    use crate::nn::{Activation, Dense, Isa, Lstm};

    fn network() -> Arc<Layout> {
        let mut layout = Layout::new();
        Lstm::new(&mut layout, "lstm", 43, 40);
        Dense::new(&mut layout, "wide", 258, 256, Activation::Relu);
        Dense::new(&mut layout, "small", 3, 2, Activation::Relu);
        Arc::new(layout)
    }

    #[test]
    fn transposed_copies_follow_every_update_on_every_instruction_set() {
        let layout = network();
        let first = Parameters::<f32>::initialised(&layout, &mut ChaCha8Rng::seed_from_u64(1));
        for isa in Isa::available() {
            let mut parameters = Parameters::zeros(&layout, true);
            let mut compute = Compute::with_isa(isa, 2).unwrap();
            parameters.update_with(&mut compute, |_, values| values.copy_from_slice(&first.values));
            for place in layout.matrices() {
                let (plain, transposed) = (parameters.at(place), parameters.transposed_at(place));
                let outputs = place.padded_outputs();
                for output in 0..outputs {
                    for input in 0..padded(place.inputs) {
                        let at = (output / PANEL * place.inputs + input) * PANEL + output % PANEL;
                        let expected = if input < place.inputs { plain[at] } else { 0.0 };
                        let at = (input / PANEL * outputs + output) * PANEL + input % PANEL;
                        assert_eq!(transposed[at], expected, "{isa:?} output {output} input {input}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_target_network_follows_and_copies() {
        let layout = network();
        let online = Parameters::<f64>::initialised(&layout, &mut ChaCha8Rng::seed_from_u64(2));
        let mut target = Parameters::zeros(&layout, false);
        target.follow(&mut Compute::new(1), &online, 0.25);
        let tensor = |p: &Parameters<f64>| p.tensor("wide.weight").unwrap();
        assert!(tensor(&target).iter().zip(tensor(&online)).all(|(t, o)| (t - 0.25 * o).abs() < 1e-16));
        target.copy_from(&online);
        assert_eq!(tensor(&target), tensor(&online));
    }

    #[test]
    fn initial_weights_are_pytorchs_uniform() {
        let layout = network();
        let parameters = Parameters::<f64>::initialised(&layout, &mut ChaCha8Rng::seed_from_u64(3));
        for (name, bound) in [("lstm.weight_ih_l0", 40f64), ("lstm.bias_hh_l0", 40.0), ("wide.weight", 258.0)]
        {
            let (bound, values) = (bound.sqrt().recip(), parameters.tensor(name).unwrap());
            let largest = values.iter().fold(0.0f64, |a, x| a.max(x.abs()));
            assert!(largest <= bound && largest > 0.95 * bound, "{name}");
            let mean_square = values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64;
            assert!((mean_square / (bound * bound / 3.0) - 1.0).abs() < 0.15, "{name}");
        }
    }
}
