//! tf2_msgs/TFMessage: the transforms of head and tail.

use serde::Serialize;

use super::{HasStamp, Header, Pose, Quaternion, Time, Xyz};
use bench_dragon_messages::{FrameHeader, HandlePose, Stage};

/// geometry_msgs/TransformStamped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransformStamped {
    /// The frame's stamp; the frame `stage`.
    pub header: Header,
    /// `<name>/head` or `<name>/tail`; with several dragons `<name>/<dragon>/head`.
    pub child_frame_id: String,
    /// The translation, in metres.
    pub translation: Xyz,
    /// The heading.
    pub rotation: Quaternion,
}

/// tf2_msgs/TFMessage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TfMessage {
    /// Head and tail of each dragon.
    pub transforms: Vec<TransformStamped>,
    /// The handle of each transform.
    #[serde(skip)]
    handles: Vec<usize>,
}

impl TfMessage {
    /// Creates the transforms of the publisher `name` and the dragons of its stage, without positions.
    pub fn of(name: &str, stage: &Stage) -> Self {
        let transform = |of: &str, end: &str| TransformStamped {
            header: Header::of(0),
            child_frame_id: if of.is_empty() { format!("{name}/{end}") } else { format!("{name}/{of}/{end}") },
            translation: Xyz::default(),
            rotation: Quaternion::of_heading(0.0),
        };
        let (mut transforms, mut handles) = (Vec::new(), Vec::new());
        for dragon in stage.dragons.iter() {
            transforms.extend(["head", "tail"].map(|end| transform(dragon.name.as_str(), end)));
            let [first, benches] = [dragon.first_handle, dragon.benches].map(|number| number as usize);
            handles.extend([first, first + benches]);
        }
        Self { transforms, handles }
    }

    /// Sets head and tail to the first and the last handle of each dragon of a frame.
    pub fn update(&mut self, frame: &FrameHeader, handles: &[HandlePose]) {
        let stamp = Time::of(frame.stamp_ns);
        let ends = self.handles.iter().map(|handle| handles.get(*handle));
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
