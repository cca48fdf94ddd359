//! What tests of several crates share. The program contains none of it.

pub mod simulated;
