//! Open water with passing rules: the paper's training environment.

mod config;
mod field;
mod path;

pub use config::{CpaKind, MotionKind, OpenWaterConfig};
pub use field::{Agent, Field, Obstacle, Passing, PassingRule};
pub use path::DesiredPath;
