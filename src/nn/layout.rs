//! Where the tensors of a network lie in one flat vector.
//!
//! A matrix `W[outputs][inputs]` is kept ready for the product `x W^T`: its rows are dealt out to panels of
//! [`PANEL`] outputs, and within a panel the weights of one input lie side by side,
//! `[panels][inputs][PANEL]`. Optimisers work element by element and do not care; files and tests read
//! and write tensors in PyTorch's order through this table. Padding stays zero for ever: its gradients are.

use super::Real;

/// Columns of a panel: two vectors of the widest instruction set.
pub(crate) const PANEL: usize = 32;

/// `count` rounded up to whole panels.
pub(crate) fn padded(count: usize) -> usize {
    count.next_multiple_of(PANEL)
}

/// One tensor of a network.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    name: String,
    shape: Vec<usize>,
    bound: f64,
    place: Place,
}

impl Tensor {
    /// PyTorch's name, such as `lstm.weight_ih_l0`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// PyTorch's shape: `[outputs, inputs]` or `[outputs]`.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Number of elements.
    pub fn elements(&self) -> usize {
        self.shape.iter().product()
    }

    /// Largest magnitude of an initial weight (PyTorch's defaults are uniform).
    pub(crate) fn bound(&self) -> f64 {
        self.bound
    }

    /// Where the elements lie in the flat vector, in PyTorch's row-major order.
    pub fn positions(&self) -> impl Iterator<Item = usize> + '_ {
        let place = self.place;
        let inputs = self.shape.get(1).copied().unwrap_or(1);
        (0..self.shape[0]).flat_map(move |row| (0..inputs).map(move |column| place.position(row, column)))
    }
}

/// A matrix or bias in the flat vector. Outputs come in `groups` (the gates of an LSTM), each padded to whole
/// panels on its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub offset: usize,
    pub inputs: usize,
    pub group: usize,
    pub groups: usize,
    /// Where the transposed copy for the backward product starts in [`Parameters`](super::Parameters).
    pub transposed: usize,
}

impl Place {
    /// Outputs, padding included.
    pub fn padded_outputs(&self) -> usize {
        self.groups * padded(self.group)
    }

    /// Elements, padding included.
    pub fn len(&self) -> usize {
        self.padded_outputs() * self.inputs
    }

    /// Elements of the transposed copy, `[panels of inputs][padded outputs][PANEL]`.
    pub fn transposed_len(&self) -> usize {
        self.padded_outputs() * padded(self.inputs)
    }

    fn position(&self, row: usize, column: usize) -> usize {
        let output = row / self.group * padded(self.group) + row % self.group;
        self.offset + (output / PANEL * self.inputs + column) * PANEL + output % PANEL
    }
}

/// The table of a network's tensors, filled by the constructors of its layers.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layout {
    tensors: Vec<Tensor>,
    len: usize,
    transposed_len: usize,
}

impl Layout {
    /// No tensors yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The tensors in the order of their layers.
    pub fn tensors(&self) -> &[Tensor] {
        &self.tensors
    }

    /// Length of the flat vector, padding included.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn transposed_len(&self) -> usize {
        self.transposed_len
    }

    /// Number of weights, padding not counted.
    pub fn weights(&self) -> usize {
        self.tensors.iter().map(Tensor::elements).sum()
    }

    pub(crate) fn matrices(&self) -> impl Iterator<Item = Place> + '_ {
        self.tensors.iter().filter(|t| t.shape.len() == 2).map(|t| t.place)
    }

    /// Adds `name`, of shape `[groups * group, inputs]`, to be initialised uniformly within `bound`.
    pub(crate) fn add_matrix(
        &mut self,
        name: String,
        group: usize,
        groups: usize,
        inputs: usize,
        bound: f64,
    ) -> Place {
        let place = Place { offset: self.len, inputs, group, groups, transposed: self.transposed_len };
        self.transposed_len += place.transposed_len();
        self.add(name, vec![groups * group, inputs], bound, place)
    }

    /// Adds the bias `name`, of shape `[groups * group]`.
    pub(crate) fn add_bias(&mut self, name: String, group: usize, groups: usize, bound: f64) -> Place {
        let place = Place { offset: self.len, inputs: 1, group, groups, transposed: 0 };
        self.add(name, vec![groups * group], bound, place)
    }

    fn add(&mut self, name: String, shape: Vec<usize>, bound: f64, place: Place) -> Place {
        assert!(shape.iter().all(|&n| n > 0), "{name} has no elements: shape {shape:?}");
        assert!(self.tensors.iter().all(|t| t.name != name), "two tensors are called {name}");
        self.len += place.len();
        self.tensors.push(Tensor { name, shape, bound, place });
        place
    }

    /// The elements of `tensor` in PyTorch's order, out of a flat vector of this layout.
    pub fn gather<T: Real>(&self, tensor: &Tensor, flat: &[T]) -> Vec<T> {
        tensor.positions().map(|position| flat[position]).collect()
    }

    /// Writes the elements of `tensor`, given in PyTorch's order, into a flat vector of this layout.
    pub fn scatter<T: Real>(&self, tensor: &Tensor, elements: &[T], flat: &mut [T]) {
        assert_eq!(elements.len(), tensor.elements(), "{}", tensor.name);
        for (position, &element) in tensor.positions().zip(elements) {
            flat[position] = element;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_distinct_and_inside() {
        let mut layout = Layout::new();
        layout.add_matrix("a".into(), 5, 4, 3, 1.0);
        layout.add_bias("b".into(), 5, 4, 1.0);
        layout.add_matrix("c".into(), 40, 1, 33, 1.0);
        let mut seen = vec![false; layout.len()];
        for tensor in layout.tensors() {
            for position in tensor.positions() {
                assert!(!std::mem::replace(&mut seen[position], true));
            }
        }
        assert_eq!(seen.iter().filter(|&&s| s).count(), layout.weights());
        assert_eq!(layout.weights(), 60 + 20 + 1320);
    }

    #[test]
    fn gather_returns_what_scatter_wrote() {
        let mut layout = Layout::new();
        layout.add_matrix("a".into(), 40, 2, 33, 1.0);
        let tensor = layout.tensors()[0].clone();
        let elements: Vec<f64> = (0..tensor.elements()).map(|i| i as f64).collect();
        let mut flat = vec![0.0; layout.len()];
        layout.scatter(&tensor, &elements, &mut flat);
        assert_eq!(layout.gather(&tensor, &flat), elements);
    }
}
