//! Integration tests: one binary, one module per subject.

mod architecture;
mod cli;
mod cpa;
mod forecast_network;
