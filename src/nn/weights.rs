//! Weights on disk: safetensors files with PyTorch's names and layout.
//!
//! A file holds one or more flat vectors, told apart by a prefix of their tensor names: the weights of a
//! network under `""` or `"actor."`, moments of an optimiser under `"adam.first."`. Short facts (scales, sizes,
//! seeds) go into the file's metadata. Everything a file holds must be asked for: a tensor that is left over
//! is an error, since nothing is dropped silently.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};

use super::{Layout, Parameters, Real};
use crate::atomic_file;

/// Why weights could not be saved or loaded.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// The file could not be read.
    #[error("cannot read {} ({source}): check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error(transparent)]
    Write(#[from] atomic_file::WriteError),
    /// The bytes are not a whole safetensors file.
    #[error("{}: not a safetensors file, or a truncated one ({reason}); copy or download it again", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A tensor of the network is not in the file.
    #[error("{}: tensor `{name}` is missing; the file holds: {present}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// What is there instead.
        present: String,
    },
    /// A tensor has another shape than the network's.
    #[error("{}: tensor `{name}` has shape {found:?}, the network needs {expected:?}; was it made for other layer sizes?", path.display())]
    Shape {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Shape in the file.
        found: Vec<usize>,
        /// Shape in the network.
        expected: Vec<usize>,
    },
    /// A tensor is not of 32- or 64-bit floating point numbers.
    #[error("{}: tensor `{name}` is of type {found}, not F32 or F64; convert it first", path.display())]
    Type {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Its type.
        found: String,
    },
    /// A weight is infinite or not a number.
    #[error("{}: element {index} of tensor `{name}` is {value}; the training that wrote it diverged", path.display())]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Row-major index of the first such element.
        index: usize,
        /// The element.
        value: f64,
    },
    /// The file holds tensors that no network asked for.
    #[error("{}: tensors that this network does not have: {names}", path.display())]
    LeftOver {
        /// The file.
        path: PathBuf,
        /// The tensors.
        names: String,
    },
    /// A fact is missing from the file's metadata or is not what it should be.
    #[error("{}: metadata `{key}` {reason}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// The key.
        key: String,
        /// What is wrong.
        reason: String,
    },
}

/// Collects tensors and facts, then writes them at once.
#[derive(Debug, Default)]
pub struct WeightsWriter {
    tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
    metadata: HashMap<String, String>,
}

impl WeightsWriter {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds every tensor of a flat vector of the given layout, in its own precision, under `{prefix}{name}`.
    pub fn tensors<T: Real>(mut self, prefix: &str, layout: &Layout, flat: &[T]) -> Self {
        for tensor in layout.tensors() {
            let mut bytes = Vec::with_capacity(tensor.elements() * size_of::<T>());
            for position in tensor.positions() {
                flat[position].write_bytes(&mut bytes);
            }
            let name = format!("{prefix}{}", tensor.name());
            self.tensors.push((name, T::DTYPE, tensor.shape().to_vec(), bytes));
        }
        self
    }

    /// Adds a fact.
    pub fn fact(mut self, key: &str, value: impl ToString) -> Self {
        self.metadata.insert(key.to_owned(), value.to_string());
        self
    }

    /// The file's bytes; the same for the same content.
    pub fn to_bytes(&self) -> Vec<u8> {
        let views = self.tensors.iter().map(|(name, dtype, shape, bytes)| {
            let view = TensorView::new(*dtype, shape.clone(), bytes).expect("bytes were made from the shape");
            (name.as_str(), view)
        });
        let mut bytes = serialize(views, None).expect("views were checked one by one");
        if !self.metadata.is_empty() {
            bytes = with_metadata(&bytes, &self.metadata);
        }
        bytes
    }

    /// Writes the file. It appears whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), WeightsError> {
        Ok(atomic_file::write(path, |file| file.write_all(&self.to_bytes()))?)
    }
}

/// Puts facts into the header of a safetensors file in sorted order: the library writes them in the order of a
/// hash table, which changes from run to run.
fn with_metadata(bytes: &[u8], metadata: &HashMap<String, String>) -> Vec<u8> {
    let (length, rest) = bytes.split_at(8);
    let length = u64::from_le_bytes(length.try_into().expect("eight bytes")) as usize;
    let (header, data) = rest.split_at(length);
    let sorted: std::collections::BTreeMap<_, _> = metadata.iter().collect();
    let facts = serde_json::to_string(&sorted).expect("a map of strings");
    let mut new = format!("{{\"__metadata__\":{facts}").into_bytes();
    let tensors = header[1..].trim_ascii_end();
    if tensors != b"}" {
        new.push(b',');
    }
    new.extend_from_slice(tensors);
    new.resize(new.len().next_multiple_of(8), b' ');
    let mut file = (new.len() as u64).to_le_bytes().to_vec();
    file.extend_from_slice(&new);
    file.extend_from_slice(data);
    file
}

/// A weights file in memory.
#[derive(Debug)]
pub struct WeightsFile {
    path: PathBuf,
    bytes: Vec<u8>,
    metadata: HashMap<String, String>,
    unread: RefCell<BTreeSet<String>>,
}

impl WeightsFile {
    /// Reads and checks the file as a whole.
    pub fn open(path: &Path) -> Result<Self, WeightsError> {
        let bytes =
            std::fs::read(path).map_err(|source| WeightsError::Read { path: path.to_owned(), source })?;
        Self::from_bytes(path, bytes)
    }

    /// The same from bytes; `path` is what errors call them.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, WeightsError> {
        let malformed = |reason: String| WeightsError::Malformed { path: path.to_owned(), reason };
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|e| malformed(e.to_string()))?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let unread = RefCell::new(header.tensors().into_keys().collect());
        Ok(Self { path: path.to_owned(), bytes, metadata, unread })
    }

    /// The file's name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A fact, parsed.
    pub fn fact<V: std::str::FromStr>(&self, key: &str) -> Result<V, WeightsError> {
        let error =
            |reason: String| WeightsError::Metadata { path: self.path.clone(), key: key.into(), reason };
        let text = self.metadata.get(key).ok_or_else(|| error("is missing".into()))?;
        text.parse().map_err(|_| error(format!("is `{text}`, which is not a valid value")))
    }

    /// Whether there is a tensor of that name.
    pub fn contains(&self, name: &str) -> bool {
        self.parsed().is_ok_and(|tensors| tensors.tensor(name).is_ok())
    }

    /// Fills a flat vector of the given layout from the tensors `{prefix}{name}`; F32 and F64 are converted.
    pub fn read<T: Real>(&self, prefix: &str, layout: &Layout, flat: &mut [T]) -> Result<(), WeightsError> {
        let tensors = self.parsed()?;
        for tensor in layout.tensors() {
            let name = format!("{prefix}{}", tensor.name());
            let view = tensors.tensor(&name).map_err(|_| self.missing(&name))?;
            if view.shape() != tensor.shape() {
                return Err(WeightsError::Shape {
                    path: self.path.clone(),
                    name,
                    found: view.shape().to_vec(),
                    expected: tensor.shape().to_vec(),
                });
            }
            let values = self.numbers(&name, &view)?;
            for (position, value) in tensor.positions().zip(values) {
                flat[position] = T::from_f64(value);
            }
            self.unread.borrow_mut().remove(&name);
        }
        Ok(())
    }

    /// Fills the weights of a network, as [`read`](Self::read) does.
    pub fn read_parameters<T: Real>(
        &self,
        prefix: &str,
        parameters: &mut Parameters<T>,
    ) -> Result<(), WeightsError> {
        let layout = std::sync::Arc::clone(parameters.layout());
        parameters.update(|values| self.read(prefix, &layout, values))
    }

    /// An error if any tensor was not read.
    pub fn finish(self) -> Result<(), WeightsError> {
        let unread = self.unread.into_inner();
        if unread.is_empty() {
            return Ok(());
        }
        let names = unread.into_iter().collect::<Vec<_>>().join(", ");
        Err(WeightsError::LeftOver { path: self.path, names })
    }

    fn parsed(&self) -> Result<SafeTensors<'_>, WeightsError> {
        SafeTensors::deserialize(&self.bytes)
            .map_err(|e| WeightsError::Malformed { path: self.path.clone(), reason: e.to_string() })
    }

    fn missing(&self, name: &str) -> WeightsError {
        let mut present: Vec<String> = match self.parsed() {
            Ok(tensors) => tensors.names().into_iter().map(str::to_owned).collect(),
            Err(_) => Vec::new(),
        };
        present.sort();
        let present = if present.is_empty() { "nothing".into() } else { present.join(", ") };
        WeightsError::Missing { path: self.path.clone(), name: name.into(), present }
    }

    fn numbers(&self, name: &str, view: &TensorView<'_>) -> Result<Vec<f64>, WeightsError> {
        let values: Vec<f64> = match view.dtype() {
            Dtype::F32 => view.data().as_chunks().0.iter().map(|&b| f32::from_le_bytes(b).into()).collect(),
            Dtype::F64 => view.data().as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect(),
            other => {
                let found = format!("{other:?}");
                return Err(WeightsError::Type { path: self.path.clone(), name: name.into(), found });
            }
        };
        match values.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(WeightsError::NotFinite {
                path: self.path.clone(),
                name: name.into(),
                index,
                value: values[index],
            }),
            None => Ok(values),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::nn::{Activation, Dense, Lstm};

    fn layout(hidden: usize) -> Arc<Layout> {
        let mut layout = Layout::new();
        Lstm::new(&mut layout, "lstm", 3, hidden);
        Dense::new(&mut layout, "linear", hidden, 2, Activation::Identity);
        Arc::new(layout)
    }

    fn parameters(hidden: usize) -> Parameters<f32> {
        Parameters::initialised(&layout(hidden), &mut ChaCha8Rng::seed_from_u64(7))
    }

    fn bytes(parameters: &Parameters<f32>) -> Vec<u8> {
        let writer = WeightsWriter::new().tensors("", parameters.layout(), parameters.values());
        writer.fact("scale", 0.1).fact("origin", "a test").to_bytes()
    }

    fn file(bytes: Vec<u8>) -> Result<WeightsFile, WeightsError> {
        WeightsFile::from_bytes(Path::new("some.safetensors"), bytes)
    }

    #[test]
    fn what_is_saved_is_loaded_bit_for_bit() {
        let saved = parameters(5);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("net.safetensors");
        let writer = WeightsWriter::new().tensors("", saved.layout(), saved.values()).fact("scale", 0.1);
        writer.save(&path).unwrap();
        let mut loaded = Parameters::<f32>::zeros(&layout(5), true);
        let file = WeightsFile::open(&path).unwrap();
        file.read_parameters("", &mut loaded).unwrap();
        assert_eq!(file.fact::<f64>("scale").unwrap(), 0.1);
        file.finish().unwrap();
        assert_eq!(saved.values(), loaded.values());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn the_same_weights_make_the_same_file() {
        let parameters = parameters(4);
        assert_eq!(bytes(&parameters), bytes(&parameters));
    }

    #[test]
    fn names_and_shapes_are_those_of_pytorch() {
        let layout = layout(5);
        let tensors: Vec<_> = layout.tensors().iter().map(|t| (t.name(), t.shape().to_vec())).collect();
        let expected = [
            ("lstm.weight_ih_l0", vec![20, 3]),
            ("lstm.weight_hh_l0", vec![20, 5]),
            ("lstm.bias_ih_l0", vec![20]),
            ("lstm.bias_hh_l0", vec![20]),
            ("linear.weight", vec![2, 5]),
            ("linear.bias", vec![2]),
        ];
        assert_eq!(tensors, expected);
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = bytes(&parameters(2));
        for length in 0..bytes.len() {
            let error = file(bytes[..length].to_vec()).unwrap_err();
            assert!(matches!(error, WeightsError::Malformed { .. }), "{length}: {error}");
        }
    }

    #[test]
    fn wrong_shapes_missing_and_left_over_tensors_are_named() {
        let file = file(bytes(&parameters(5))).unwrap();
        let message = |result: Result<(), WeightsError>| result.unwrap_err().to_string();
        let wrong = message(file.read_parameters("", &mut Parameters::<f32>::zeros(&layout(6), false)));
        assert!(wrong.contains("some.safetensors") && wrong.contains("`lstm.weight_ih_l0`"), "{wrong}");
        assert!(wrong.contains("[20, 3]") && wrong.contains("[24, 3]"), "{wrong}");
        let missing =
            message(file.read_parameters("actor.", &mut Parameters::<f32>::zeros(&layout(5), false)));
        assert!(missing.contains("`actor.lstm.weight_ih_l0` is missing"), "{missing}");
        assert!(message(file.fact::<f64>("origin").map(drop)).contains("`a test`"));
        assert!(message(file.fact::<f64>("width").map(drop)).contains("is missing"));
        assert!(message(file.finish()).contains("linear.bias, linear.weight"));
    }

    #[test]
    fn weights_that_are_not_numbers_are_refused() {
        let mut parameters = parameters(5);
        let position = parameters.layout().tensors()[4].positions().nth(3).unwrap();
        parameters.update(|values| values[position] = f32::NAN);
        let file = file(bytes(&parameters)).unwrap();
        let error = file.read_parameters("", &mut Parameters::<f64>::zeros(&layout(5), false)).unwrap_err();
        assert!(
            matches!(error, WeightsError::NotFinite { ref name, index: 3, .. } if name == "linear.weight")
        );
    }

    #[test]
    fn paths_that_cannot_be_read_or_written_are_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let below_a_file = file.path().join("net.safetensors");
        let written = WeightsWriter::new().save(&below_a_file).unwrap_err().to_string();
        let read = WeightsFile::open(&below_a_file).unwrap_err().to_string();
        assert!(written.contains("net.safetensors"), "{written}");
        assert!(read.contains("net.safetensors"), "{read}");
    }
}
