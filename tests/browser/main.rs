//! The stage page in a real browser.

mod conduct;
#[path = "../harness/mod.rs"]
mod harness;
mod proved;
mod several;
mod view;
