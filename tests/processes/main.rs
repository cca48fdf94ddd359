//! The program as users start it: publishers, subscribers and commands in separate processes.

mod chase;
mod cli;
mod command_client;
mod control;
mod faults;
mod feed;
#[path = "../harness/mod.rs"]
mod harness;
mod light;
mod list;
mod live;
mod log;
mod lost_files;
mod metrics;
mod osc;
mod outputs_of_dragons;
mod placed;
mod python_module;
mod qr_code;
mod readers;
mod record;
mod replay;
mod scene;
mod second_publisher;
mod send;
mod service_manager;
mod several;
mod soak;
mod soak_verdict;
mod timecode;
mod transports;
mod tunnel;
mod watch;
