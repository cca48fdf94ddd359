//! Elementary functions of doubles with the same bits on every machine.
//!
//! The standard library calls the C library of the machine, whose last digits differ between versions and processors.
//! These functions come from the crate `libm`, which is compiled into the program. Every number of a frame and of a log
//! depends on them, so a test in `model` checks that this crate and `show` call no others. Square roots, `mul_add` and
//! the remainder are exact in IEEE 754, so they stay with the standard library.

pub use libm::{acos, asin, asinh, atan, atan2, cos, hypot, pow, sin, sincos as sin_cos, tan};
