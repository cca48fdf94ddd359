//! ROS 2 topics and services, with Cyclone DDS, Fast DDS and ros2-client as peers.

mod fast_dds;
#[path = "../harness/mod.rs"]
mod harness;
mod ros2;
mod ros2_control;
mod ros2_examples;
mod ros2_feed;
mod ros2_several;
mod ros2_topics;
