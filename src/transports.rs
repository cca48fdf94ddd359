//! Where frames go: publishers of the loop. They know messages and frames, never the solver, and not each other.

pub mod iceoryx2;
#[cfg(feature = "ros2")]
pub mod ros2;
