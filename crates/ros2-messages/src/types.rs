//! The type of every topic, with its names in DDS and in ROS 2 tools, and its definition as text.
//!
//! The ROS 2 transport needs the names; recordings contain the definitions. The definitions of the program's messages
//! are the files of `msgs/msg`; the definitions of standard packages are the fields alone.

use std::collections::BTreeMap;

use crate::settings::Topic;

/// A message type: its package and its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageType {
    package: &'static str,
    name: &'static str,
}

impl MessageType {
    /// Returns the type of a topic.
    pub const fn of(topic: Topic) -> Self {
        let (package, name) = match topic {
            Topic::Handles => (OWN, "HandlePoses"),
            Topic::Poses => ("geometry_msgs", "PoseArray"),
            Topic::Alerts => (OWN, "CollisionAlert"),
            Topic::Stage => (OWN, "Stage"),
            Topic::Diagnostics => ("diagnostic_msgs", "DiagnosticArray"),
            Topic::Markers => ("visualization_msgs", "MarkerArray"),
            Topic::Status => (OWN, "LoopStatus"),
            Topic::Path => ("nav_msgs", "Path"),
            Topic::Cues => (OWN, "Cue"),
            Topic::Clock => ("rosgraph_msgs", "Clock"),
            Topic::Tf => ("tf2_msgs", "TFMessage"),
        };
        Self { package, name }
    }

    /// Returns the name in DDS: `geometry_msgs::msg::dds_::PoseArray_`.
    pub fn dds_name(self) -> String {
        format!("{}::msg::dds_::{}_", self.package, self.name)
    }

    /// Returns the name in tools: `geometry_msgs/msg/PoseArray`.
    pub fn ros_name(self) -> String {
        format!("{}/msg/{}", self.package, self.name)
    }

    /// Returns the definition, and the definitions of all its parts, in the schema encoding `ros2msg`. Before each part
    /// are a line of 80 equals signs and a line with its name.
    pub fn schema(self) -> String {
        let own_name = format!("{}/{}", self.package, self.name);
        let mut names = vec![own_name.clone()];
        let mut schema = String::new();
        let mut next = 0;
        while let Some(name) = names.get(next).cloned() {
            next += 1;
            // A test checks that the table is complete.
            let definition = definition(&name).unwrap_or_default();
            if name != own_name {
                schema += &format!("{}\nMSG: {name}\n", "=".repeat(80));
            }
            schema += definition;
            for part in parts(&name, definition) {
                if !names.contains(&part) {
                    names.push(part);
                }
            }
        }
        schema
    }
}

/// Returns the part of a `ros2msg` schema on which the bytes of a message `name`, `package/Name`, depend. This part is
/// the fields of every type in it, each as type and name, in order. Comments and constants are left out, and every type
/// has its package.
pub fn fields(name: &str, schema: &str) -> BTreeMap<String, Vec<[String; 2]>> {
    let (mut of, mut fields) = (name.to_owned(), BTreeMap::from([(name.to_owned(), Vec::new())]));
    for line in schema.lines().map(|line| line.split('#').next().unwrap_or_default().trim()) {
        if let Some(name) = line.strip_prefix("MSG:") {
            of = name.trim().to_owned();
            fields.entry(of.clone()).or_default();
        } else if let Some((kind, name)) = line.split_once(char::is_whitespace).filter(|(_, name)| !name.contains('='))
        {
            fields.entry(of.clone()).or_default().push([with_package(kind, &of), name.trim().to_owned()]);
        }
    }
    fields
}

/// Returns the type of a field. A message type without package gets the package of `of`.
fn with_package(kind: &str, of: &str) -> String {
    let package = of.split('/').next().unwrap_or_default();
    if kind.contains('/') || !kind.starts_with(char::is_uppercase) {
        kind.to_owned()
    } else {
        format!("{package}/{kind}")
    }
}

/// The package of the program's own messages.
const OWN: &str = "bench_dragon_msgs";

/// Returns the definition of a type, `package/Name`.
fn definition(name: &str) -> Option<&'static str> {
    DEFINITIONS.iter().find(|(of, _)| *of == name).map(|(_, definition)| *definition)
}

/// Returns the message types, `package/Name`, of a definition's fields.
fn parts(name: &str, definition: &str) -> Vec<String> {
    let words = definition.lines().filter_map(|line| line.split('#').next()?.split_whitespace().next());
    let types = words.map(|word| word.split('[').next().unwrap_or_default());
    let messages = types.filter(|of| of.contains('/') || of.starts_with(char::is_uppercase));
    messages.map(|of| with_package(of, name)).collect()
}

/// All types of the topics. The standard types have their fields in order, on which the bytes depend.
const DEFINITIONS: [(&str, &str); 34] = [
    ("bench_dragon_msgs/CollisionAlert", include_str!("../../../msgs/msg/CollisionAlert.msg")),
    ("bench_dragon_msgs/Cue", include_str!("../../../msgs/msg/Cue.msg")),
    ("bench_dragon_msgs/HandlePose", include_str!("../../../msgs/msg/HandlePose.msg")),
    ("bench_dragon_msgs/HandlePoses", include_str!("../../../msgs/msg/HandlePoses.msg")),
    ("bench_dragon_msgs/LoopStatus", include_str!("../../../msgs/msg/LoopStatus.msg")),
    ("bench_dragon_msgs/Stage", include_str!("../../../msgs/msg/Stage.msg")),
    ("bench_dragon_msgs/StageCue", include_str!("../../../msgs/msg/StageCue.msg")),
    ("bench_dragon_msgs/StageDragon", include_str!("../../../msgs/msg/StageDragon.msg")),
    ("bench_dragon_msgs/StageEvent", include_str!("../../../msgs/msg/StageEvent.msg")),
    ("bench_dragon_msgs/StageObstacle", include_str!("../../../msgs/msg/StageObstacle.msg")),
    ("bench_dragon_msgs/StageSegment", include_str!("../../../msgs/msg/StageSegment.msg")),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("diagnostic_msgs/DiagnosticArray", "std_msgs/Header header\nDiagnosticStatus[] status\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n",
    ),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Pose", "Point position\nQuaternion orientation\n"),
    ("geometry_msgs/PoseArray", "std_msgs/Header header\nPose[] poses\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\nPose pose\n"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    ("geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation\n"),
    ("geometry_msgs/TransformStamped", "std_msgs/Header header\nstring child_frame_id\nTransform transform\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("nav_msgs/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    ("rosgraph_msgs/Clock", "builtin_interfaces/Time clock\n"),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    (
        "visualization_msgs/Marker",
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n\
         bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\n\
         sensor_msgs/CompressedImage texture\nUVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n\
         MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
    ),
    ("visualization_msgs/MarkerArray", "Marker[] markers\n"),
    ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n"),
    ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_every_topic_is_defined_once() {
        let mut used = Vec::new();
        for topic in Topic::ALL {
            let MessageType { package, name } = MessageType::of(topic);
            used.push(format!("{package}/{name}"));
            let schema = MessageType::of(topic).schema();
            for line in schema.lines().filter_map(|line| line.strip_prefix("MSG: ")) {
                assert!(definition(line).is_some_and(|text| !text.is_empty()), "{topic:?} is made of {line}");
                used.push(line.to_owned());
            }
        }
        used.sort_unstable();
        used.dedup();
        assert_eq!(used, DEFINITIONS.map(|(name, _)| name), "sorted, none unused, none missing");
    }

    #[test]
    fn definitions_that_are_written_otherwise_have_the_same_fields() {
        let schema =
            "uint8 ON=1\n# A lamp.\npkg/Place place # where\n\nfloat64[]  levels\n===\nMSG: pkg/Place\nfloat64 x\n";
        let other = "Place place\nfloat64[] levels\n===\nMSG: pkg/Place\nfloat64   x\nuint8 LAST=2\n";
        assert_eq!(fields("pkg/Lamp", schema), fields("pkg/Lamp", other));
        let of = fields("pkg/Lamp", schema)["pkg/Lamp"].iter().map(|field| field.join(" ")).collect::<Vec<_>>();
        assert_eq!(of, ["pkg/Place place", "float64[] levels"]);
        let (own, name) = (MessageType::of(Topic::Handles).schema(), "bench_dragon_msgs/HandlePoses");
        assert_eq!(fields(name, &own)["bench_dragon_msgs/HandlePose"].len(), 5);
        assert_ne!(fields(name, &own), fields(name, &own.replace("float64 vx", "float32 vx")));
    }

    #[test]
    fn both_spellings_are_of_one_type() {
        let of = MessageType::of(Topic::Tf);
        assert_eq!((&*of.dds_name(), &*of.ros_name()), ("tf2_msgs::msg::dds_::TFMessage_", "tf2_msgs/msg/TFMessage"));
    }
}
