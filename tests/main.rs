//! Integration tests: one binary, one module per subject.

mod architecture;
mod cli;
mod forecast_network;
