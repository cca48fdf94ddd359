//! `msgs/` and the Rust types that go on the wire cannot drift apart: fields, types, order and constants are compared.
#![cfg(feature = "ros2")]

use std::collections::BTreeMap;

use bench_dragon::show::state::{FrameState, Level, PlaybackState};
use bench_dragon::transports::ros2::messages::{HandlePoses, Header, Stamped, type_name};
use bench_dragon::wire::{
    CollisionAlert, FrameHeader, HandlePose, LoopStatus, NO_BENCH, SEGMENT_ARC, SEGMENT_INWARD_SPIRAL, SEGMENT_LINE,
    SEGMENT_OUTWARD_SPIRAL, Stage, StageSegment,
};
use serde::Serialize;
use serde_reflection::{ContainerFormat, Format, Registry, Samples, Tracer, TracerConfig};

/// A `.msg` file: (type, field) in order, and the constants. Every one of them must be followed by a comment.
struct Interface {
    fields: Vec<(String, String)>,
    constants: BTreeMap<String, u32>,
}

fn interface(name: &str) -> Interface {
    let path = format!("{}/msgs/msg/{name}.msg", env!("CARGO_MANIFEST_DIR"));
    let mut interface = Interface { fields: Vec::new(), constants: BTreeMap::new() };
    for line in std::fs::read_to_string(&path).unwrap().lines() {
        let (declaration, comment) = line.split_once('#').map_or((line, None), |(code, text)| (code, Some(text)));
        let mut words = declaration.split_whitespace();
        let (Some(kind), Some(name)) = (words.next(), words.next()) else { continue };
        if let Some((constant, value)) = name.split_once('=') {
            assert_eq!(kind, "uint32");
            interface.constants.insert(constant.to_owned(), value.parse().unwrap());
        } else {
            assert!(comment.is_some_and(|text| text.trim().len() > 2), "{path}: {name} has no comment");
            interface.fields.push((kind.to_owned(), name.to_owned()));
        }
    }
    interface
}

/// What serde writes for a message: (type, field) in the words of ROS 2, nested layouts taken apart.
fn on_the_wire<T: Serialize>(message: &T) -> Vec<(String, String)> {
    let mut tracer = Tracer::new(TracerConfig::default());
    let (format, _) = tracer.trace_value(&mut Samples::new(), message).unwrap();
    let registry = tracer.registry().unwrap();
    let Format::TypeName(name) = format else { panic!("a message is a struct") };
    fields(&registry, &name)
}

fn fields(registry: &Registry, name: &str) -> Vec<(String, String)> {
    let ContainerFormat::Struct(members) = &registry[name] else { panic!("{name} is no struct") };
    let mut all = Vec::new();
    for member in members {
        match &member.value {
            Format::TypeName(inner) if inner != "Header" => all.extend(fields(registry, inner)),
            format => all.push((ros(format), member.name.clone())),
        }
    }
    all
}

fn ros(format: &Format) -> String {
    match format {
        Format::F64 => "float64".to_owned(),
        Format::U64 => "uint64".to_owned(),
        Format::U32 => "uint32".to_owned(),
        Format::Str => "string".to_owned(),
        Format::TypeName(name) if name == "Header" => "std_msgs/Header".to_owned(),
        Format::TypeName(name) => name.clone(),
        Format::Seq(element) => format!("{}[]", ros(element)),
        Format::TupleArray { content, size } => format!("{}[{size}]", ros(content)),
        other => panic!("{other:?} is in no .msg file"),
    }
}

#[test]
fn fields_types_and_order_are_those_of_the_interface_files() {
    let frame =
        HandlePoses { header: Header::of(0), frame: FrameHeader::default(), poses: vec![HandlePose::default()] };
    for (name, wire) in [
        ("HandlePose", on_the_wire(&HandlePose::default())),
        ("HandlePoses", on_the_wire(&frame)),
        ("CollisionAlert", on_the_wire(&Stamped::alert(CollisionAlert::default()))),
        ("LoopStatus", on_the_wire(&Stamped::status(LoopStatus::default()))),
        ("Stage", on_the_wire(&Stamped::stage(Stage::default()))),
        ("StageSegment", on_the_wire(&StageSegment::default())),
    ] {
        assert_eq!(interface(name).fields, wire, "{name}");
    }
}

#[test]
fn type_names_are_those_that_ros_2_gives_the_interface_files() {
    let package = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/msgs/package.xml")).unwrap();
    assert!(package.contains("<name>bench_dragon_msgs</name>"));
    let list = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/msgs/CMakeLists.txt")).unwrap();
    for (name, on_the_wire) in [
        ("HandlePoses", type_name::HANDLE_POSES),
        ("CollisionAlert", type_name::COLLISION_ALERT),
        ("LoopStatus", type_name::LOOP_STATUS),
        ("Stage", type_name::STAGE),
    ] {
        assert_eq!(on_the_wire, format!("bench_dragon_msgs::msg::dds_::{name}_"));
    }
    for file in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/msgs/msg")).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap();
        assert!(list.contains(&format!("\"msg/{name}\"")), "{name} is not built");
    }
}

#[test]
fn constants_are_the_states_levels_and_playback() {
    fn constants<const N: usize>(prefix: &str, of: [(&str, u32); N]) -> BTreeMap<String, u32> {
        of.into_iter().map(|(name, number)| (format!("{prefix}{}", name.to_uppercase()), number)).collect()
    }
    let states = constants("STATE_", FrameState::ALL.map(|state| (state.name(), state as u32)));
    let levels = constants("LEVEL_", Level::ALL.map(|level| (level.name(), level as u32)));
    let events = FrameState::ALL.map(|state| state.event().map(|event| (event.name(), state as u32)));
    let events = constants("EVENT_", [("none", 0), events[2].unwrap(), events[3].unwrap(), events[4].unwrap()]);
    let playback = constants("PLAYBACK_", PlaybackState::ALL.map(|playback| (playback.name(), playback as u32)));
    let no_bench = BTreeMap::from([("NO_BENCH".to_owned(), NO_BENCH)]);
    let joined = |parts: &[&BTreeMap<String, u32>]| -> BTreeMap<String, u32> {
        parts.iter().flat_map(|part| part.iter().map(|(name, number)| (name.clone(), *number))).collect()
    };
    assert_eq!(interface("HandlePoses").constants, joined(&[&states, &playback]));
    assert_eq!(interface("CollisionAlert").constants, joined(&[&levels, &events, &no_bench]));
    let segments = [
        ("LINE", SEGMENT_LINE),
        ("ARC", SEGMENT_ARC),
        ("INWARD_SPIRAL", SEGMENT_INWARD_SPIRAL),
        ("OUTWARD_SPIRAL", SEGMENT_OUTWARD_SPIRAL),
    ];
    assert_eq!(interface("StageSegment").constants, constants("", segments));
}

#[test]
fn viewers_are_set_up_for_topics_that_exist() {
    use bench_dragon::scene::ros2::Topic;
    let all = [Topic::Handles, Topic::Poses, Topic::Alerts, Topic::Stage, Topic::Markers, Topic::Status];
    let topics = all.map(|topic| topic.path("bench_dragon"));
    let foxglove = include_str!("../examples/foxglove/bench_dragon.json");
    serde_json::from_str::<serde_json::Value>(foxglove).unwrap();
    for viewer in [foxglove, include_str!("../examples/rviz/bench_dragon.rviz")] {
        let named: Vec<String> = viewer
            .match_indices("/bench_dragon/")
            .map(|(at, _)| {
                viewer[at..].chars().take_while(|c| c.is_ascii_alphanumeric() || "/_".contains(*c)).collect()
            })
            .collect();
        assert!(named.contains(&topics[4]), "no markers in {named:?}");
        assert!(named.iter().all(|topic| topics.contains(topic)), "{named:?}");
    }
}
