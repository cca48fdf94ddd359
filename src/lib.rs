//! A bench dragon, live: where every handle of a coiling chain of benches is, published at a fixed rate.
//!
//! Data flows one way, and each module uses only those above it in this list:
//!
//! - [`model`]: curves and the path made of them, the board, the separation of two boards. Pure functions.
//! - [`linkage`]: links on a path: the follower and how a link lies.
//! - [`solve`]: from the head's travel to the state of every handle; several solvers behind one interface.
//! - [`motion`]: a team on a path: its solver, its events, its clearance.
//! - [`scene`]: the file a user writes, checked and turned into the types above.
//! - [`show`]: from a scene and a tick to one frame, deterministic.
//! - [`certify`]: events and speeds with a proof; of events, as a certificate that other code can check.
//! - [`plan`]: the least pitch and the greatest speed, for a choreographer.
//! - [`wire`]: the memory layouts that go over the wire, and every conversion to them.
//! - `ros2_messages` (features `cli`, `jazzy`, `humble`): the messages of ROS 2, on its network and in recordings.
//! - `drawing` (feature `cli`): a moment of a motion as an SVG, and the colours of all pictures.
//! - [`live`]: the fixed-rate loop, its clock, its statistics.
//! - [`transports`]: iceoryx2 shared memory and ROS 2 topics, as publishers of the loop.
//! - `recording` (feature `cli`): the log of a run, the proof that it can be played again, and every message as MCAP.
//! - [`subscribers`]: the feed of a publisher's messages, the terminal monitor, the stage picture, the soak test; no solver.
//! - `proof` (feature `cli`): the checker of certificates of events; it uses none of the others.
//! - [`trade`]: accuracy against cost, measured for every solver on a scene and this machine.

#![deny(missing_docs)]

#[cfg(all(feature = "jazzy", feature = "humble"))]
compile_error!("choose one ROS 2 distribution: `--no-default-features --features cli,humble` for Humble");

pub mod certify;
#[cfg(feature = "cli")]
pub mod drawing;
pub mod linkage;
pub mod live;
pub mod model;
pub mod motion;
pub mod plan;
#[cfg(feature = "cli")]
pub mod proof;
#[cfg(feature = "cli")]
pub mod recording;
#[cfg(any(feature = "cli", feature = "ros2"))]
pub mod ros2_messages;
pub mod scene;
pub mod show;
pub mod solve;
pub mod subscribers;
pub mod trade;
pub mod transports;
pub mod wire;
