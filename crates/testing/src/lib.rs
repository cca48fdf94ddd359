//! What tests of several crates share. The program contains none of it.

pub mod model;
pub mod simulated;
