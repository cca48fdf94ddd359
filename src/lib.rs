//! A bench dragon, live: where every handle of a coiling chain of benches is, published at a fixed rate.
//!
//! Data flows one way, and each module uses only those above it in this list:
//!
//! - [`messages`]: the memory layouts that go over the wire.
//! - [`geometry`]: the path, the board, the separation of two boards. Pure functions.
//! - [`chain`]: from the head's travel to the state of every handle; several solvers behind one interface.
//! - [`clearance`]: which two boards of a chain are nearest.
//! - [`events`]: when, exactly, something ends the show.
//! - [`scene`]: the file a user writes, checked and turned into the types above.
//! - [`show`]: from a scene and a tick to one frame, deterministic.
//! - [`plan`]: the least pitch and the greatest speed, for a choreographer.
//! - [`live`]: the fixed-rate loop, its clock, its statistics.
//! - [`transports`]: iceoryx2 shared memory and ROS 2 topics, as publishers of the loop.
//! - [`trade`]: accuracy against cost, measured for every solver on a scene and this machine.
//! - [`subscribers`]: the terminal monitor and the stage picture; they know the messages only.

#![deny(missing_docs)]

#[cfg(all(feature = "jazzy", feature = "humble"))]
compile_error!("choose one ROS 2 distribution: `--no-default-features --features humble` for Humble");

pub mod chain;
pub mod clearance;
pub mod events;
pub mod geometry;
pub mod live;
pub mod messages;
pub mod plan;
pub mod scene;
pub mod show;
pub mod subscribers;
pub mod trade;
pub mod transports;
