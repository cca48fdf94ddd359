//! The layouts of earlier versions, found by the fields of a recording's types, because a bag of `ros2 bag record`
//! names no version of this program.
//!
//! In: the type of a topic, as a recording describes it. Out: the name of its layout.

use bench_dragon_ros2_messages::settings::Topic;

/// The layouts of a topic's message, the newest first. Each layout has a field, of its own or of a message in it, that
/// older layouts do not have.
const fn history(topic: Topic) -> &'static [(&'static str, &'static str)] {
    match topic {
        Topic::Stage => &[
            ("Stage/7", "tail_length"),
            ("Stage/6", "dragons"),
            ("Stage/5", "scene_hash"),
            ("Stage/4", "cue_list"),
            ("Stage/3", "segments"),
            ("Stage/2", "pieces"),
            ("Stage/1", "pitch"),
        ],
        Topic::Handles => &[("FrameHeader/2", "epoch"), ("FrameHeader/1", "deadline_ns")],
        Topic::Alerts => &[("CollisionAlert/2", "event_bench_a"), ("CollisionAlert/1", "time_to_event")],
        Topic::Status => {
            &[("LoopStatus/3", "lost_files"), ("LoopStatus/2", "unforeseen_contacts"), ("LoopStatus/1", "overruns")]
        }
        Topic::Cues => &[("Cue/1", "cue_time")],
        _ => &[],
    }
}

/// Returns two layouts of a topic's message. The first is the layout of a recording with these fields, those of messages in it included, `None` if no earlier
/// version had this layout. The second is the layout of this program.
pub fn layouts<'f>(
    topic: Topic,
    fields: impl Iterator<Item = &'f [String; 2]> + Clone,
) -> (Option<&'static str>, &'static str) {
    let known = history(topic);
    let found = known.iter().find(|(_, field)| fields.clone().any(|[_, name]| name == field));
    let own = known.first().map_or("", |(layout, _)| layout);
    (found.map(|(layout, _)| *layout).filter(|layout| *layout != own), own)
}

#[cfg(test)]
mod tests {
    use bench_dragon_client::layouts::names;
    use bench_dragon_ros2_messages::{MessageType, fields};

    use super::*;

    const TOPICS: [Topic; 5] = [Topic::Stage, Topic::Handles, Topic::Alerts, Topic::Status, Topic::Cues];

    fn found(topic: Topic, names: &str) -> Option<&'static str> {
        let fields: Vec<_> = names.split(' ').map(|name| [String::new(), name.to_owned()]).collect();
        layouts(topic, fields.iter()).0
    }

    #[test]
    fn the_newest_layouts_are_this_programs() {
        for topic in TOPICS {
            let (newest, field) = history(topic)[0];
            assert!(names().contains(&format!("bench_dragon/{newest}").as_str()), "{newest} has a successor");
            let name = MessageType::of(topic).ros_name().replace("/msg/", "/");
            let own = fields(&name, &MessageType::of(topic).schema());
            assert!(own.values().flatten().any(|[_, name]| name == field), "{newest} has no {field}");
        }
    }

    /// The fields of the files in `msgs` of earlier versions.
    #[test]
    fn earlier_layouts_are_told_by_their_fields() {
        let geometry = "header run_id stamp_ns pitch start_turn hole_inset head_length body_length width";
        let events = "freeze_time benches segments events cues";
        for (layout, rest) in [
            ("Stage/6", &format!("{events} scene_hash dragons obstacles cue_list") as &str),
            ("Stage/5", &format!("{events} scene_hash path timeline cue_list") as &str),
            ("Stage/4", &format!("{events} path timeline cue_list")),
            ("Stage/3", "benches segments path"),
            ("Stage/2", "benches pieces path"),
            ("Stage/1", "benches reserved"),
        ] {
            assert_eq!(found(Topic::Stage, &format!("{geometry} {rest}")), Some(layout));
        }
        let frame =
            "header run_id sequence tick stamp_ns sent_ns deadline_ns sim_time time_scale min_clearance handles";
        assert_eq!(found(Topic::Handles, &format!("{frame} state poses")), Some("FrameHeader/1"));
        let alert = "header run_id tick stamp_ns sim_time event_time time_to_event clearance x y level bench_a bench_b";
        assert_eq!(found(Topic::Alerts, alert), Some("CollisionAlert/1"));
        assert_eq!(found(Topic::Status, "header run_id rate measured_rate overruns skipped"), Some("LoopStatus/1"));
        for topic in TOPICS {
            assert_eq!(found(topic, "header nothing"), None);
        }
    }
}
