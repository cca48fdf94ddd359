//! The messages of other languages: `crates/messages/src/layouts.rs` and the enums in `crates/messages/src/state.rs`
//! are the single source of fields, types, versions, constants and their comments. `msgs/msg/*.msg` and
//! `packaging/python/bench_dragon/layouts.py` are generated from these: after a change run
//!
//! ```text
//! BENCH_DRAGON_WRITE=1 cargo test --test repository msgs::
//! ```
//!
//! and commit the written files. Without the variable the first test fails if a file differs. A new field needs its
//! line in the layout, and the next version in the layout's `type_name`. It also needs its value in the code that fills
//! in the message. A new message also needs its line in `ros::MESSAGES`, in `msgs/CMakeLists.txt` and in the
//! comparisons below.
//!
//! The generator reads the text of the sources and does not check itself. All other tests compare the files with the
//! compiled Rust types, by serde's output and by the offsets of their fields in memory.
#![cfg(feature = "ros2")]

mod memory;
mod python;
mod render;
mod ros;
mod source;

use std::collections::BTreeMap;
use std::process::Command;
use std::sync::LazyLock;

use bench_dragon::messages::state::{FrameState, Level, PlaybackState};
use bench_dragon::messages::{
    ChaseStatus, CollisionAlert, ControlRequest, ControlResponse, Cue, FrameHeader, HandlePose, HandlePose32, List,
    LoopStatus, NO_BENCH, OBSTACLE_BOUNDARY, OBSTACLE_CIRCLE, OBSTACLE_LINE, OBSTACLE_POLYGON, SEGMENT_ARC,
    SEGMENT_INWARD_SPIRAL, SEGMENT_LINE, SEGMENT_OUTWARD_SPIRAL, SceneHeader, Stage, StageCue, StageDragon, StageEvent,
    StageMessage, StageObstacle, StageSegment,
};
use bench_dragon::ros2_messages::settings::Topic;
use bench_dragon::ros2_messages::{HandlePoses, Header, MessageType, Stamped};
use iceoryx2::prelude::ZeroCopySend;
use serde::Serialize;
use serde_json::{Value, json};
use serde_reflection::{ContainerFormat, Format, Registry, Samples, Tracer, TracerConfig};
use source::Source;

const PYTHON: &str = "packaging/python/bench_dragon/layouts.py";

fn path(file: &str) -> String {
    format!("{}/{file}", env!("CARGO_MANIFEST_DIR"))
}

fn read(file: &str) -> String {
    std::fs::read_to_string(path(file)).unwrap_or_default()
}

/// The generated files, written first if requested, with a sentence on each difference. All tests that read the files
/// start here.
static DIFFERENCES: LazyLock<Vec<String>> = LazyLock::new(|| {
    let source = Source::read();
    let interfaces = ros::MESSAGES.iter();
    let interfaces =
        interfaces.map(|message| (format!("msgs/msg/{}.msg", message.name), ros::interface_file(&source, message)));
    let module = python::module(&source);
    let mut differences = Vec::new();
    for (file, wanted) in interfaces.chain([(PYTHON.to_owned(), module)]) {
        let found = read(&file);
        if found == wanted {
            continue;
        }
        if std::env::var_os("BENCH_DRAGON_WRITE").is_some() {
            std::fs::write(path(&file), wanted).unwrap();
        } else {
            differences.push(format!(
                "{file} does not follow from crates/messages/src/layouts.rs: run BENCH_DRAGON_WRITE=1 cargo test --test repository msgs::\n{}",
                difference(&found, &wanted)
            ));
        }
    }
    differences
});

/// Returns the lines that only one of two texts has, by their longest common subsequence.
fn difference(found: &str, wanted: &str) -> String {
    let (found, wanted): (Vec<_>, Vec<_>) = (found.lines().collect(), wanted.lines().collect());
    // Number of lines that the ends of both texts, from a line of each on, have in common.
    let mut common = vec![vec![0; wanted.len() + 1]; found.len() + 1];
    for (i, j) in (0..found.len()).rev().flat_map(|i| (0..wanted.len()).rev().map(move |j| (i, j))) {
        let skipped = common[i + 1][j].max(common[i][j + 1]);
        common[i][j] = if found[i] == wanted[j] { common[i + 1][j + 1] + 1 } else { skipped };
    }
    let (mut text, mut i, mut j) = (String::new(), 0, 0);
    while i < found.len() || j < wanted.len() {
        if i < found.len() && j < wanted.len() && found[i] == wanted[j] {
            (i, j) = (i + 1, j + 1);
        } else if i < found.len() && (j == wanted.len() || common[i + 1][j] >= common[i][j + 1]) {
            text += &format!("{:>4} - {}\n", i + 1, found[i]);
            i += 1;
        } else {
            text += &format!("{:>4} + {}\n", j + 1, wanted[j]);
            j += 1;
        }
    }
    text
}

#[test]
fn generated_files_are_those_of_the_sources() {
    assert!(DIFFERENCES.is_empty(), "{}", DIFFERENCES.join("\n"));
    let files = std::fs::read_dir(path("msgs/msg")).unwrap();
    let mut files: Vec<_> = files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    let mut messages = ros::MESSAGES.map(|message| format!("{}.msg", message.name));
    files.sort();
    messages.sort();
    assert_eq!(files, messages, "another file in msgs/msg");
}

/// A `.msg` file: (type, field) in order, and the constants. There is a comment above every one of them.
struct Interface {
    fields: Vec<(String, String)>,
    constants: BTreeMap<String, u32>,
}

fn interface(name: &str) -> Interface {
    LazyLock::force(&DIFFERENCES);
    let mut interface = Interface { fields: Vec::new(), constants: BTreeMap::new() };
    let mut has_comment = false;
    for line in read(&format!("msgs/msg/{name}.msg")).lines() {
        let mut words = line.split_whitespace();
        let declaration = match (words.next(), words.next()) {
            (Some(kind), Some(name)) if kind != "#" => Some((kind, name)),
            _ => None,
        };
        if let Some((kind, field)) = declaration {
            assert!(has_comment, "{name}: {field} has no comment");
            if let Some((constant, value)) = field.split_once('=') {
                assert_eq!(kind, "uint32");
                interface.constants.insert(constant.to_owned(), value.parse().unwrap());
            } else {
                interface.fields.push((kind.to_owned(), field.to_owned()));
            }
        }
        has_comment = line.starts_with("# ");
    }
    interface
}

/// A stage with one element in each list: serde shows no element of an empty list.
fn full_stage() -> Stage {
    Stage {
        dragons: List::of([StageDragon::default()]),
        obstacles: List::of([StageObstacle::default()]),
        events: List::of([StageEvent::default()]),
        cue_list: List::of([StageCue::default()]),
        ..Stage::default()
    }
}

/// Returns serde's output for a message: (type, field) in the words of ROS 2, with nested layouts expanded.
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
        Format::F32 => "float32".to_owned(),
        Format::U64 => "uint64".to_owned(),
        Format::U32 => "uint32".to_owned(),
        Format::U8 => "uint8".to_owned(),
        Format::Str => "string".to_owned(),
        Format::TypeName(name) if name == "Header" => "std_msgs/Header".to_owned(),
        Format::TypeName(name) => name.clone(),
        Format::Seq(element) => format!("{}[]", ros(element)),
        Format::TupleArray { content, size } => format!("{}[{size}]", ros(content)),
        other => panic!("{other:?} is in no .msg file"),
    }
}

#[test]
fn fields_types_and_order_are_those_that_serde_writes() {
    let frame =
        HandlePoses { header: Header::of(0), frame: FrameHeader::default(), poses: vec![HandlePose::default()] };
    let wire = [
        ("HandlePose", on_the_wire(&HandlePose::default())),
        ("HandlePoses", on_the_wire(&frame)),
        ("CollisionAlert", on_the_wire(&Stamped::alert(CollisionAlert::default()))),
        ("LoopStatus", on_the_wire(&Stamped::status(LoopStatus::default()))),
        (
            "Stage",
            on_the_wire(&Stamped::stage(StageMessage { stage: full_stage(), segments: vec![StageSegment::default()] })),
        ),
        ("Cue", on_the_wire(&Stamped::cue(Cue::default()))),
        ("StageSegment", on_the_wire(&StageSegment::default())),
        ("StageDragon", on_the_wire(&StageDragon::default())),
        ("StageObstacle", on_the_wire(&StageObstacle::default())),
        ("StageEvent", on_the_wire(&StageEvent::default())),
        ("StageCue", on_the_wire(&StageCue::default())),
    ];
    assert_eq!(wire.len(), ros::MESSAGES.len(), "a message is not compared");
    for (name, wire) in wire {
        assert_eq!(interface(name).fields, wire, "{name}");
    }
}

#[test]
fn type_names_are_those_that_ros_2_gives_the_interface_files() {
    assert!(read("msgs/package.xml").contains("<name>bench_dragon_msgs</name>"));
    for (name, topic) in [
        ("HandlePoses", Topic::Handles),
        ("CollisionAlert", Topic::Alerts),
        ("LoopStatus", Topic::Status),
        ("Stage", Topic::Stage),
        ("Cue", Topic::Cues),
    ] {
        assert_eq!(MessageType::of(topic).dds_name(), format!("bench_dragon_msgs::msg::dds_::{name}_"));
    }
    let list = read("msgs/CMakeLists.txt");
    for ros::Message { name, .. } in &ros::MESSAGES {
        assert!(list.contains(&format!("\"msg/{name}.msg\"")), "{name} is not built");
    }
}

/// The names of numbers in the compiled enums and constants.
struct Names {
    states: Vec<&'static str>,
    /// By number; not every number is a level.
    levels: Vec<Option<&'static str>>,
    playback: Vec<&'static str>,
    segments: Vec<&'static str>,
    obstacles: Vec<&'static str>,
    /// All events that lead to a state, by its number.
    events: BTreeMap<u32, &'static str>,
    /// The events that an alert can be about.
    alerted: BTreeMap<u32, &'static str>,
}

fn names() -> Names {
    fn in_order<const N: usize>(values: [(u32, &'static str); N]) -> Vec<&'static str> {
        let values = values.into_iter().enumerate();
        values
            .map(|(at, (number, name))| if at == number as usize { name } else { panic!("{name} is {number}") })
            .collect()
    }
    let kind = |kind| StageSegment { kind, ..Default::default() }.kind_name();
    let segments = [SEGMENT_LINE, SEGMENT_ARC, SEGMENT_INWARD_SPIRAL, SEGMENT_OUTWARD_SPIRAL];
    assert_eq!(kind(segments.len() as u32), "unknown", "a segment is not compared");
    let shape = |kind| StageObstacle { kind, ..Default::default() }.kind_name();
    let obstacles = [OBSTACLE_CIRCLE, OBSTACLE_POLYGON, OBSTACLE_LINE, OBSTACLE_BOUNDARY];
    assert_eq!(shape(obstacles.len() as u32), "unknown", "an obstacle is not compared");
    let events = FrameState::ALL.into_iter().filter_map(|state| Some((state as u32, state.event()?)));
    let alerted = events.clone().filter(|(_, kind)| Level::of(*kind).is_some());
    Names {
        states: in_order(FrameState::ALL.map(|state| (state as u32, state.name()))),
        levels: (0..=Level::ALL.map(|level| level as u32).into_iter().max().unwrap())
            .map(|number| Level::ALL.into_iter().find(|level| *level as u32 == number).map(Level::name))
            .collect(),
        playback: in_order(PlaybackState::ALL.map(|playback| (playback as u32, playback.name()))),
        segments: in_order(segments.map(|number| (number, kind(number)))),
        obstacles: in_order(obstacles.map(|number| (number, shape(number)))),
        events: events.map(|(number, kind)| (number, kind.name())).collect(),
        alerted: alerted.map(|(number, kind)| (number, kind.name())).collect(),
    }
}

#[test]
fn constants_are_the_states_levels_events_playback_and_segments() {
    let constant = |prefix: &str, name: &str| format!("{prefix}{}", name.to_uppercase());
    let in_order = |prefix: &str, names: &[&str]| -> BTreeMap<String, u32> {
        names.iter().zip(0..).map(|(name, number)| (constant(prefix, name), number)).collect()
    };
    let joined = |parts: [BTreeMap<String, u32>; 2]| parts.into_iter().flatten().collect::<BTreeMap<_, _>>();
    let names = names();
    let frame = joined([in_order("STATE_", &names.states), in_order("PLAYBACK_", &names.playback)]);
    assert_eq!(interface("HandlePoses").constants, frame);
    let levels = names.levels.iter().zip(0..).filter_map(|(name, number)| Some((constant("LEVEL_", (*name)?), number)));
    let mut alert: BTreeMap<String, u32> = levels.collect();
    alert.extend(names.alerted.iter().map(|(number, name)| (constant("EVENT_", name), *number)));
    alert.extend([("EVENT_NONE".to_owned(), 0), ("NO_BENCH".to_owned(), NO_BENCH)]);
    assert_eq!(interface("CollisionAlert").constants, alert);
    assert_eq!(interface("StageSegment").constants, in_order("", &names.segments));
    assert_eq!(interface("StageObstacle").constants, in_order("", &names.obstacles));
    assert_eq!(interface("StageEvent").constants, in_order("STATE_", &names.states));
    for name in ["HandlePose", "LoopStatus", "Stage", "Cue", "StageDragon", "StageCue"] {
        assert_eq!(interface(name).constants, BTreeMap::new(), "{name}");
    }
}

/// Returns a layout as Python must see it: its name for iceoryx2, its size, and each field's name, type, offset and
/// size.
fn layout<T: Serialize + ZeroCopySend + Default>() -> Value {
    layout_of(&T::default())
}

fn layout_of<T: Serialize + ZeroCopySend>(value: &T) -> Value {
    let members = memory::members(value);
    let types = on_the_wire(value);
    assert_eq!(members.len(), types.len());
    let fields = members.iter().zip(&types).map(|((name, offset, size), (kind, name_on_the_wire))| {
        assert_eq!(name, name_on_the_wire);
        json!([name, kind, offset, size])
    });
    let fields: Vec<_> = fields.collect();
    let filled: usize = members.iter().map(|(_, _, size)| size).sum();
    assert_eq!(filled, size_of::<T>(), "there is padding");
    // SAFETY: only a name is read.
    json!([unsafe { <T as ZeroCopySend>::type_name() }, size_of::<T>(), fields])
}

/// Prints Python's data on the layouts, in the words of ROS 2, and the names of numbers.
const SCRIPT: &str = r#"
import ctypes, json, sys
sys.path.insert(0, "packaging/python")
import bench_dragon as m

WORDS = {ctypes.c_double: "float64", ctypes.c_float: "float32", ctypes.c_uint64: "uint64", ctypes.c_uint32: "uint32",
         ctypes.c_uint8: "uint8"}

def word(of):
    if hasattr(of, "ELEMENT"):
        return f"{word(of.ELEMENT)}[]"
    if issubclass(of, ctypes.Array):
        # A text is as long as no array of other bytes is.
        is_text = of._type_ is ctypes.c_uint8 and of._length_ == 64
        return "string" if is_text else f"{word(of._type_)}[{of._length_}]"
    return WORDS.get(of) or of.__name__

def layout(of):
    fields = [(name, word(kind), getattr(of, name).offset, getattr(of, name).size) for name, kind in of._fields_]
    return of.type_name(), ctypes.sizeof(of), fields

print(json.dumps({
    "messages": [layout(message) for message in m.MESSAGES],
    "parts": [layout(part) for part in [m.StageDragon, m.StageObstacle, m.StageEvent, m.StageCue]],
    "names": [m.STATES, m.LEVELS, m.PLAYBACK, m.SEGMENTS, m.EVENTS, m.OBSTACLES],
    "no_bench": m.NO_BENCH,
    "handle_poses": [m.HANDLE_POSE.itemsize, m.HANDLE_POSE_32.itemsize],
}))
"#;

#[test]
fn python_sees_the_layouts_and_the_names_of_rust() {
    LazyLock::force(&DIFFERENCES);
    let interpreter = std::env::var_os("BENCH_DRAGON_PYTHON").unwrap_or("python3".into());
    let output = Command::new(interpreter).current_dir(path("")).args(["-c", SCRIPT]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    let messages = [
        layout::<HandlePose>(),
        layout::<HandlePose32>(),
        layout::<FrameHeader>(),
        layout::<CollisionAlert>(),
        layout::<LoopStatus>(),
        layout::<ChaseStatus>(),
        layout::<Cue>(),
        layout::<ControlRequest>(),
        layout::<ControlResponse>(),
        layout::<StageSegment>(),
        layout::<SceneHeader>(),
        layout_of(&full_stage()),
    ];
    assert_eq!(printed["messages"].as_array().unwrap().len(), messages.len(), "a message is not compared");
    for (of_python, of_rust) in printed["messages"].as_array().unwrap().iter().zip(messages) {
        assert_eq!(*of_python, of_rust);
    }
    let parts = [layout::<StageDragon>(), layout::<StageObstacle>(), layout::<StageEvent>(), layout::<StageCue>()];
    assert_eq!(printed["parts"], json!(parts));
    let Names { states, levels, playback, segments, obstacles, events, .. } = names();
    let mut events: BTreeMap<_, _> = events.iter().map(|(number, name)| (number.to_string(), Some(*name))).collect();
    events.insert("0".to_owned(), None);
    assert_eq!(printed["names"], json!([states, levels, playback, segments, events, obstacles]));
    assert_eq!(printed["no_bench"], json!(NO_BENCH));
    assert_eq!(printed["handle_poses"], json!([size_of::<HandlePose>(), size_of::<HandlePose32>()]));
}

#[test]
fn sizes_and_versions_are_those_that_other_programs_rely_on() {
    let fixed = [layout::<HandlePose>(), layout::<FrameHeader>(), layout::<CollisionAlert>()];
    let fixed = fixed.map(|layout| (layout[0].as_str().unwrap().to_owned(), layout[1].as_u64().unwrap()));
    let expected = [("HandlePose/1", 40), ("FrameHeader/2", 96), ("CollisionAlert/2", 112)];
    assert_eq!(fixed, expected.map(|(name, size)| (format!("bench_dragon/{name}"), size)));
}

#[test]
fn viewers_are_set_up_for_topics_that_exist() {
    use bench_dragon::ros2_messages::settings::Topic;
    let all = [Topic::Handles, Topic::Poses, Topic::Alerts, Topic::Stage, Topic::Markers, Topic::Status];
    let topics = all.map(|topic| topic.path("bench_dragon"));
    let foxglove = include_str!("../../examples/foxglove/bench_dragon.json");
    serde_json::from_str::<serde_json::Value>(foxglove).unwrap();
    for viewer in [foxglove, include_str!("../../examples/rviz/bench_dragon.rviz")] {
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
