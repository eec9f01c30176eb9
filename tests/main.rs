//! Integration tests: one binary, one module per subject.

mod architecture;
mod cli;
mod cpa;
mod forecast_network;
mod rl_golden;
mod rl_learning;
