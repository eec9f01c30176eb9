//! Integration tests: one binary, one module per subject.

#![allow(clippy::unwrap_used)]

mod agents;
mod ais;
mod architecture;
mod benchmark;
mod browser;
mod cli;
mod cpa;
mod cpa_cli;
mod experiment;
mod forecast;
mod forecast_network;
mod gallery;
mod nn_allocation;
mod noise;
mod replay;
mod rl;
mod scenario;
mod sweep;
mod train;
mod vessel;
