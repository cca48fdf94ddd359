//! A bench dragon, live: the place of every handle of a coiling chain of benches, published at a fixed rate.
//!
//! This library is the crates of the workspace under one name. Without the feature `library` it is [`messages`] and
//! [`client`]: all that a subscriber compiles. `ARCHITECTURE.md` draws how the crates depend on each other.
//!
//! - [`messages`]: layouts, states, commands and JSON of what a publisher and its subscribers exchange.
//! - [`client`]: follow, interpolate and command a running publisher.
//!
//! With the feature `library`, which the program needs:
//!
//! - `motion`: the path, the solvers, the events, the clearance. Pure.
//! - `show`: the scene file, checked, and its frames by tick. Deterministic.
//! - `certify`: events, clearances and speeds with a proof; the plans of a choreographer.
//! - `proof`: the checker of certificates, which depends on no other crate of this workspace.
//! - `publisher`: the fixed-rate loop, its shared memory, its log.
//! - `ros2_messages`, `ros2`: the messages of ROS 2, and its topics and services.
//! - `recording`: MCAP recordings, their replay, and the verification of logs.
//! - `chase`: a show follows timecode, or a performer with a tracker.
//! - `outputs`: the stage page, PosiStageNet, OSC, metrics.
//! - `design`: a scene edited as text and as a picture.
//! - `soak`, `trade`, `drawing`: the soak test, the measurements of accuracy against cost, the pictures.
//! - `fit`: numbers of a scene changed until the show keeps what it must.
//! - `sheets`: hand-outs for the people who carry the benches.

#![deny(missing_docs)]

#[cfg(all(feature = "jazzy", feature = "humble"))]
compile_error!("choose one ROS 2 distribution: `--no-default-features --features cli,humble` for Humble");

#[cfg(feature = "library")]
pub use bench_dragon_certify as certify;
#[cfg(feature = "library")]
pub use bench_dragon_chase as chase;
pub use bench_dragon_client as client;
#[cfg(feature = "library")]
pub use bench_dragon_design as design;
#[cfg(feature = "library")]
pub use bench_dragon_drawing as drawing;
#[cfg(feature = "library")]
pub use bench_dragon_fit as fit;
pub use bench_dragon_messages as messages;
#[cfg(feature = "library")]
pub use bench_dragon_motion as motion;
#[cfg(feature = "library")]
pub use bench_dragon_outputs as outputs;
#[cfg(feature = "library")]
pub use bench_dragon_proof as proof;
#[cfg(feature = "library")]
pub use bench_dragon_publisher as publisher;
#[cfg(feature = "library")]
pub use bench_dragon_recording as recording;
#[cfg(feature = "ros2")]
pub use bench_dragon_ros2 as ros2;
#[cfg(feature = "library")]
pub use bench_dragon_ros2_messages as ros2_messages;
#[cfg(feature = "library")]
pub use bench_dragon_sheets as sheets;
#[cfg(feature = "library")]
pub use bench_dragon_show as show;
#[cfg(feature = "library")]
pub use bench_dragon_soak as soak;
#[cfg(feature = "library")]
pub use bench_dragon_trade as trade;
