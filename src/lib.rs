//! Searoom: a physics-grounded maritime simulator in which an agent learns to keep clear of other
//! vessels, and the place where anyone can check how well it does.
//!
//! Data flows one way, top to bottom:

pub mod ais;
pub mod angle;
pub mod geo;
pub mod route;
pub mod track;

pub mod vessel;
pub mod world;

pub mod cpa;
pub mod encounter;
pub mod forecast;
pub mod nn;

pub mod agent;
pub mod env;
pub mod policy;
pub mod report;
pub mod rl;
pub mod scenario;

pub mod episode;

pub mod experiment;

pub mod atomic_file;
pub mod cli;
pub mod config;
