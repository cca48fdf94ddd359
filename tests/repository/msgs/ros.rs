//! The interface files of `msgs/msg`.

use crate::msgs::render::{NOTICE, Target, comment, targets};
use crate::msgs::source::{Docs, Kind, Layout, Source, without_links};

/// A message of ROS 2 and the layout whose fields it has.
pub struct Message {
    pub name: &'static str,
    pub layout: &'static str,
    /// True if a `std_msgs/Header` comes first.
    has_header: bool,
}

pub const MESSAGES: [Message; 11] = [
    Message { name: "HandlePose", layout: "HandlePose", has_header: false },
    Message { name: "HandlePoses", layout: "FrameHeader", has_header: true },
    Message { name: "CollisionAlert", layout: "CollisionAlert", has_header: true },
    Message { name: "LoopStatus", layout: "LoopStatus", has_header: true },
    Message { name: "Stage", layout: "Stage", has_header: true },
    Message { name: "Cue", layout: "Cue", has_header: true },
    Message { name: "StageSegment", layout: "StageSegment", has_header: false },
    Message { name: "StageDragon", layout: "StageDragon", has_header: false },
    Message { name: "StageObstacle", layout: "StageObstacle", has_header: false },
    Message { name: "StageEvent", layout: "StageEvent", has_header: false },
    Message { name: "StageCue", layout: "StageCue", has_header: false },
];

/// The comment of a frame over ROS 2: the handles and their common values are one message.
const HANDLE_POSES: &str = "One frame: every handle of the dragon, the head first, and what is true of all of them.";
const HEADER: &str = "The stamp is stamp_ns, or simulated time with stamps = \"sim\"; frame_id is \"stage\": metres, x to \
                      the right, y up, origin at the centre.";

/// Returns the text of a message's file.
pub fn interface_file(source: &Source, message: &Message) -> String {
    let layout = source.layout(message.layout).unwrap();
    let about: Docs = match message.name {
        "HandlePoses" => vec![HANDLE_POSES.to_owned()],
        _ => layout.docs.iter().filter(|text| !text.starts_with("Over iceoryx2")).cloned().collect(),
    };
    let mut text = format!("{NOTICE}#\n{}\n", comment(&plain(source, layout, &about), ""));
    let constants = constants(source, layout);
    for Constant { name, value, docs } in &constants {
        text += &format!("{}uint32 {name}={value}\n", comment(&plain(source, layout, docs), ""));
    }
    if !constants.is_empty() {
        text += "\n";
    }
    if message.has_header {
        text += &format!("# {HEADER}\nstd_msgs/Header header\n");
    }
    for field in &layout.fields {
        let docs = comment(&plain(source, layout, &field.docs), "");
        text += &format!("{docs}{} {}\n", type_name(&field.kind), field.name);
    }
    if message.name == "Stage" {
        text += "# The segments of all paths, then of all outlines.\nStageSegment[] segments\n";
    }
    if message.name == "HandlePoses" {
        text += "# The handles, the head first.\nHandlePose[] poses\n";
    }
    text
}

/// A constant of a message.
struct Constant {
    name: String,
    value: u64,
    docs: Docs,
}

/// Returns the constants that the fields of a layout may hold: their comments link to these.
fn constants(source: &Source, layout: &Layout) -> Vec<Constant> {
    let mut constants = Vec::new();
    let mut targets = targets(source, &[&layout.name]);
    targets.sort_by_key(|target| matches!(target, Target::Constant(_)));
    for target in targets {
        match target {
            Target::Enum(names) => {
                let is_event = names.rust == "EventKind";
                if is_event {
                    let name = format!("{}NONE", names.ros);
                    constants.push(Constant { name, value: 0, docs: vec!["No event.".to_owned()] });
                }
                // An alert is only about events that raise a level.
                let levels = &source.enumeration("Level").unwrap().variants;
                let is_reported = |name: &str| !is_event || levels.iter().any(|level| level.name == name);
                let variants = &source.enumeration(names.rust).unwrap().variants;
                constants.extend(variants.iter().filter(|variant| is_reported(&variant.name)).map(|variant| {
                    Constant {
                        name: format!("{}{}", names.ros, variant.name.to_uppercase()),
                        value: variant.number,
                        docs: variant.docs.clone(),
                    }
                }));
            }
            Target::Group(prefix) => constants.extend(source.group(prefix).into_iter().map(|constant| Constant {
                name: constant.name[repeated(prefix, layout)..].to_owned(),
                value: constant.value,
                docs: constant.docs.clone(),
            })),
            Target::Constant(constant) if constant.is_on_the_wire => constants.push(Constant {
                name: constant.name.clone(),
                value: constant.value,
                docs: constant.docs.clone(),
            }),
            Target::Constant(_) | Target::Field(..) | Target::Layout(_) => {}
        }
    }
    constants
}

/// Returns the number of words of the constants' names that the message's name has: `StageSegment` has no `SEGMENT_`.
fn repeated(prefix: &str, layout: &Layout) -> usize {
    let word = prefix.trim_end_matches('_').to_lowercase();
    if layout.name.to_lowercase().ends_with(&word) { prefix.len() } else { 0 }
}

/// Returns comments as plain text: links in words of ROS 2, no backticks.
fn plain(source: &Source, own: &Layout, docs: &Docs) -> Docs {
    let message = |layout: &str| MESSAGES.iter().find(|message| message.layout == layout).unwrap().name;
    let words = |link: &str| match Target::of(source, link) {
        Target::Enum(names) => format!("{}*", names.ros),
        Target::Field(layout, field) if layout == own.name => field.to_owned(),
        Target::Field(layout, field) => format!("{}.{field}", message(layout)),
        Target::Layout(layout) => message(layout).to_owned(),
        Target::Constant(constant) if constant.is_on_the_wire => constant.name.clone(),
        Target::Constant(constant) => constant.value.to_string(),
        Target::Group(prefix) => {
            let names = source.group(prefix).into_iter().map(|constant| &constant.name[repeated(prefix, own)..]);
            names.collect::<Vec<_>>().join(", ")
        }
    };
    docs.iter().map(|text| without_links(text, words).replace('`', "")).collect()
}

fn type_name(kind: &Kind) -> String {
    match kind {
        Kind::Number(primitive) => primitive.ros.to_owned(),
        Kind::Text(_) => "string".to_owned(),
        Kind::Layout(name) => name.clone(),
        Kind::Array(element, length) => format!("{}[{length}]", type_name(element)),
        Kind::List(element, _) => format!("{}[]", type_name(element)),
    }
}
