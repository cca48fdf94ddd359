//! tf2_msgs/TFMessage: the transforms of head and tail.

use serde::Serialize;

use super::{HasStamp, Header, Pose, Quaternion, Time, Xyz};
use bench_dragon_messages::{FrameHeader, HandlePose};

/// geometry_msgs/TransformStamped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransformStamped {
    /// The frame's stamp; the frame `stage`.
    pub header: Header,
    /// `<name>/head` or `<name>/tail`.
    pub child_frame_id: String,
    /// Metres.
    pub translation: Xyz,
    /// The heading.
    pub rotation: Quaternion,
}

/// tf2_msgs/TFMessage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TfMessage {
    /// Head and tail.
    pub transforms: Vec<TransformStamped>,
}

impl TfMessage {
    /// Creates the transforms of the publisher `name`, without positions.
    pub fn of(name: &str) -> Self {
        let transform = |end: &str| TransformStamped {
            header: Header::of(0),
            child_frame_id: format!("{name}/{end}"),
            translation: Xyz::default(),
            rotation: Quaternion::of_heading(0.0),
        };
        Self { transforms: vec![transform("head"), transform("tail")] }
    }

    /// Sets head and tail to the first and the last handle of a frame.
    pub fn update(&mut self, frame: &FrameHeader, handles: &[HandlePose]) {
        let stamp = Time::of(frame.stamp_ns);
        let ends = [handles.first(), handles.last()];
        for (transform, handle) in self.transforms.iter_mut().zip(ends) {
            let Some(Pose { position, orientation }) = handle.map(Pose::of) else { continue };
            transform.header.stamp = stamp;
            (transform.translation, transform.rotation) = (position, orientation);
        }
    }
}

impl HasStamp for TfMessage {
    fn set_stamp(&mut self, stamp: Time) {
        self.transforms.iter_mut().for_each(|transform| transform.header.stamp = stamp);
    }
}
