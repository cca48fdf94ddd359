//! The stage page in a real browser.

mod conduct;
#[path = "../harness/mod.rs"]
mod harness;
mod looks;
mod proved;
mod several;
mod view;

/// One browser at a time: a second one would leave neither the processor that it needs.
static ONE_AT_A_TIME: std::sync::Mutex<()> = std::sync::Mutex::new(());
