//! Recurrent learning: equal to PyTorch, able to learn, exact across stop and resume.

mod checkpoint;
mod golden;
mod learning;
mod rollout;
mod tasks;
