//! The repository itself: pages, generated files, manifests, dependencies, words.

mod circles;
mod command_table;
mod features;
#[path = "../harness/mod.rs"]
mod harness;
mod msgs;
mod newcomer;
mod rooms;
mod supply_chain;
mod words;
