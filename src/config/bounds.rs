//! What the numbers of a configuration can be.
//!
//! Bounds are wide: they keep out what cannot be worked with, not what is unwise.

use super::Fault;

/// A share or a rate.
pub const FRACTION: [f64; 2] = [0.0, 1.0];
/// A length, time or speed that may be zero.
pub const SIZE: [f64; 2] = [0.0, 1e6];
/// One that something is divided by, or that a hull has.
pub const POSITIVE: [f64; 2] = [1e-3, 1e6];
/// Time between two positions, in seconds.
pub const STEP_S: [f64; 2] = [1e-3, 3600.0];
/// Counts of decisions, frames, updates and steps.
pub const COUNT: [f64; 2] = [0.0, 1e15];
/// Counts of which there is one at least.
pub const SOME: [f64; 2] = [1.0, 1e15];
/// Counts of what is held in memory.
pub const HELD: [f64; 2] = [1.0, 1e5];

/// A number that is checked: its key, its value, and the least and greatest that can be worked with.
pub type BoundedNumber = (&'static str, f64, [f64; 2]);

/// Checks numbers against their bounds; what is no number is out of them.
///
/// # Errors
/// The first that is out of its bounds.
pub fn check_bounds(numbers: impl IntoIterator<Item = BoundedNumber>) -> Result<(), Fault> {
    let mut numbers = numbers.into_iter();
    match numbers.find(|(_, value, [least, most])| !(least..=most).contains(&value)) {
        Some((key, value, [least, most])) => Err(Fault::new(
            key,
            format!("{value} is not possible here"),
            format!("write a number from {least} to {most}"),
        )),
        None => Ok(()),
    }
}
