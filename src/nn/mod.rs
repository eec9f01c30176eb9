//! Small recurrent networks without a framework: dense and LSTM layers, mean squared error, Adam,
//! weights on disk in PyTorch's layout.
//!
//! This module knows slices, sizes and random streams; no ships and no reinforcement learning. A network is
//! a plain struct of layers written by hand elsewhere:
//!
//! - [`Layout`] lists the tensors of a network by PyTorch's names and places them in one flat vector.
//!   [`Dense`] and [`Lstm`] are handles into it, made once.
//! - [`Parameters`] and [`Gradients`] are such vectors. Optimisers, target networks and checkpoints walk the
//!   flat vector and need not know the layers.
//! - Activations live in buffers that the caller owns and reuses. `forward` fills them, `backward` reads them
//!   and adds to the gradients. Nothing here allocates once the buffers exist.
//! - [`Compute`] says with which instructions and on how many threads. Results do not depend on the number of
//!   threads: every element is computed by the same operations in the same order, whoever computes it.
//!
//! # Conventions
//!
//! A batch of vectors is row-major, `[rows][features]`. A batch of sequences is time-major,
//! `[steps][rows][features]`. Everything is generic over [`Real`]: `f32` runs on AVX-512, AVX2 with FMA, or
//! portable code, chosen at run time; `f64` is a portable twin of the same code, for tests.

mod activation;
mod adam;
mod buffer;
mod compute;
mod dense;
mod elementwise;
mod layout;
mod loss;
mod lstm;
mod matmul;
mod parameters;
mod real;
mod simd;
#[cfg(test)]
mod testing;
mod threads;
mod transpose;
pub mod weights;

pub use activation::Activation;
pub use adam::{Adam, AdamConfig};
pub use buffer::Buffer;
pub use compute::Compute;
pub use dense::Dense;
pub use layout::{Layout, Tensor};
pub use loss::mean_squared_error;
pub use lstm::{Lstm, LstmState, LstmWindows};
pub use parameters::{Gradients, Parameters};
pub use real::Real;
pub use simd::Isa;
pub use threads::Threads;
