//! The `searoom` program.

fn main() {}
