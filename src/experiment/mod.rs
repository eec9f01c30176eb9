//! The experiments of the paper, one file each, and the statistics they rest on.

pub mod statistics;
