//! Results of the library against independent sources: tables of 50 digits, brute force, other implementations.
//! These tests start no program, so that they can be built with debug assertions and overflow checks.

mod accepted;
mod accuracy;
mod beside;
mod certificates;
mod certified_pair_clearances;
mod certified_pairs;
mod display;
mod events;
mod greatest_speed;
mod ground;
#[path = "../harness/mod.rs"]
mod harness;
mod kinks;
mod least_clearance;
mod oracle;
mod paths;
mod placement;
mod scene;
mod several;
mod show;
mod solvers;
mod staged;
mod stopped;
#[path = "../truth/tables.rs"]
mod tables;
mod truth;
