//! The stage as one owned message: the header and the segments.

use serde::{Deserialize, Serialize};

use crate::layouts::{Stage, StageDragon, StageObstacle, StageSegment};

/// A [`Stage`] with the segments of its paths and outlines. Over ROS 2 and in files, the fields of [`Stage`] and then
/// the list of segments.
#[derive(Debug, Clone, Default, PartialEq, Deserialize, Serialize)]
pub struct StageMessage {
    /// The header.
    pub stage: Stage,
    /// The segments of all paths, then of all outlines.
    pub segments: Vec<StageSegment>,
}

impl StageMessage {
    /// Returns the segments of a dragon's path, in the order of travel. Empty if the message does not have them.
    pub fn path(&self, dragon: &StageDragon) -> &[StageSegment] {
        self.part(dragon.first_segment, dragon.segments)
    }

    /// Returns the segments of an obstacle's outline. Empty if the message does not have them.
    pub fn outline(&self, obstacle: &StageObstacle) -> &[StageSegment] {
        self.part(obstacle.first_segment, obstacle.segments)
    }

    fn part(&self, first: u32, count: u32) -> &[StageSegment] {
        let first = first as usize;
        self.segments.get(first..first.saturating_add(count as usize)).unwrap_or_default()
    }
}
