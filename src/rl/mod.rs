//! Recurrent actor-critic learning: replay, networks, LSTM-TD3 and LSTM-SAC,
//! training.
//!
//! Sees environments through [`crate::env::Env`] and f32 slices; knows no ships.

pub mod actor;
pub mod agent;
pub mod checkpoint;
pub mod critics;
pub mod networks;
pub mod replay;
pub mod rollout;
pub mod sac;
pub mod td3;
pub mod trainer;
