"""A ROS 2 peer without ROS: Cyclone DDS with the types of msgs/*.msg, as `colcon build` would make them.

    ros2_peer.py --name NAME --seconds S [--topic handles:reliable:volatile] ...

Prints a JSON line for every message of the requested topics and one line at the end. With --until-each it ends a second
after each topic has had a message. The program's own types are read from the .msg files, so that a difference between
these and the wire is found.
"""

import argparse
import json
import math
import pathlib
import re
import sys
import time
import types
from dataclasses import dataclass

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, annotations, types as idl
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

MSG = pathlib.Path(__file__).resolve().parents[2] / "msgs" / "msg"

PRIMITIVES = {
    "float64": idl.float64,
    "float32": idl.float32,
    "uint64": idl.uint64,
    "uint32": idl.uint32,
    "int32": idl.int32,
    "uint8": idl.uint8,
    "bool": bool,
    "string": str,
}


def message(package, name, fields):
    """Returns a final IDL struct of the type that ROS 2 calls package/msg/name."""

    def body(namespace):
        namespace["__annotations__"] = dict(fields)
        namespace["__module__"] = __name__

    base = types.new_class(name, (IdlStruct,), {"typename": f"{package}::msg::dds_::{name}_"}, body)
    return dataclass(annotations.final(base))


Time = message("builtin_interfaces", "Time", [("sec", idl.int32), ("nanosec", idl.uint32)])
Duration = message("builtin_interfaces", "Duration", [("sec", idl.int32), ("nanosec", idl.uint32)])
Header = message("std_msgs", "Header", [("stamp", Time), ("frame_id", str)])
ColorRGBA = message("std_msgs", "ColorRGBA", [(c, idl.float32) for c in "rgba"])
Point = message("geometry_msgs", "Point", [(c, idl.float64) for c in "xyz"])
Vector3 = message("geometry_msgs", "Vector3", [(c, idl.float64) for c in "xyz"])
Quaternion = message("geometry_msgs", "Quaternion", [(c, idl.float64) for c in "xyzw"])
Pose = message("geometry_msgs", "Pose", [("position", Point), ("orientation", Quaternion)])
PoseArray = message("geometry_msgs", "PoseArray", [("header", Header), ("poses", idl.sequence[Pose])])
KeyValue = message("diagnostic_msgs", "KeyValue", [("key", str), ("value", str)])
DiagnosticStatus = message(
    "diagnostic_msgs",
    "DiagnosticStatus",
    [
        ("level", idl.uint8),
        ("name", str),
        ("message", str),
        ("hardware_id", str),
        ("values", idl.sequence[KeyValue]),
    ],
)
DiagnosticArray = message(
    "diagnostic_msgs", "DiagnosticArray", [("header", Header), ("status", idl.sequence[DiagnosticStatus])]
)
CompressedImage = message(
    "sensor_msgs", "CompressedImage", [("header", Header), ("format", str), ("data", idl.sequence[idl.uint8])]
)
UVCoordinate = message("visualization_msgs", "UVCoordinate", [("u", idl.float32), ("v", idl.float32)])
MeshFile = message("visualization_msgs", "MeshFile", [("filename", str), ("data", idl.sequence[idl.uint8])])
Marker = message(
    "visualization_msgs",
    "Marker",
    [
        ("header", Header),
        ("ns", str),
        ("id", idl.int32),
        ("type", idl.int32),
        ("action", idl.int32),
        ("pose", Pose),
        ("scale", Vector3),
        ("color", ColorRGBA),
        ("lifetime", Duration),
        ("frame_locked", bool),
        ("points", idl.sequence[Point]),
        ("colors", idl.sequence[ColorRGBA]),
        ("texture_resource", str),
        ("texture", CompressedImage),
        ("uv_coordinates", idl.sequence[UVCoordinate]),
        ("text", str),
        ("mesh_resource", str),
        ("mesh_file", MeshFile),
        ("mesh_use_embedded_materials", bool),
    ],
)
MarkerArray = message("visualization_msgs", "MarkerArray", [("markers", idl.sequence[Marker])])


PoseStamped = message("geometry_msgs", "PoseStamped", [("header", Header), ("pose", Pose)])
Path = message("nav_msgs", "Path", [("header", Header), ("poses", idl.sequence[PoseStamped])])
Clock = message("rosgraph_msgs", "Clock", [("clock", Time)])
Transform = message("geometry_msgs", "Transform", [("translation", Vector3), ("rotation", Quaternion)])
TransformStamped = message(
    "geometry_msgs",
    "TransformStamped",
    [("header", Header), ("child_frame_id", str), ("transform", Transform)],
)
Log = message(
    "rcl_interfaces",
    "Log",
    [
        ("stamp", Time),
        ("level", idl.uint8),
        ("name", str),
        ("msg", str),
        ("file", str),
        ("function", str),
        ("line", idl.uint32),
    ],
)
TFMessage = message("tf2_msgs", "TFMessage", [("transforms", idl.sequence[TransformStamped])])


def from_file(name, known):
    """Returns the type that a .msg file of this repository defines."""
    fields = []
    for line in (MSG / f"{name}.msg").read_text().splitlines():
        line = line.split("#")[0].strip()
        if not line or "=" in line:
            continue
        kind, field = line.split()
        element, _, count = kind.partition("[")
        of = PRIMITIVES.get(element) or known[element]
        count = count.removesuffix("]")
        if count:
            of = idl.array[of, int(count)]
        elif kind.endswith("[]"):
            of = idl.sequence[of]
        fields.append((field, of))
    return message("bench_dragon_msgs", name, fields)


KNOWN = {"std_msgs/Header": Header}
KNOWN["HandlePose"] = from_file("HandlePose", KNOWN)
for part in ("StageSegment", "StageDragon", "StageObstacle", "StageEvent", "StageCue"):
    KNOWN[part] = from_file(part, KNOWN)
TOPICS = {
    "handles": from_file("HandlePoses", KNOWN),
    "alerts": from_file("CollisionAlert", KNOWN),
    "status": from_file("LoopStatus", KNOWN),
    "stage": from_file("Stage", KNOWN),
    "poses": PoseArray,
    "markers": MarkerArray,
    "diagnostics": DiagnosticArray,
    "cues": from_file("Cue", KNOWN),
    "path": Path,
    "clock": Clock,
    "tf": TFMessage,
    "rosout": Log,
}


def plain(value):
    """Returns the message as JSON can hold it; NaN becomes null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (list, tuple, bytes)):
        return [plain(element) for element in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    return value


def shortened(kind, sample):
    """Returns only the first three handles of a frame and the last, so that the reader keeps up."""
    if kind in ("handles", "poses"):
        count = len(sample.poses)
        sample.poses = sample.poses[:3] + sample.poses[-1:]
        return plain(sample) | {"count": count}
    return plain(sample)


def quality(reliability, durability, depth=100):
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=1)) if reliability == "reliable" else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if durability == "transient_local" else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
    )


def offered(reader, participants):
    """Returns the quality of service of the publishers that a reader has matched, and the lease of their participants
    in seconds, as discovery reports them."""
    found = [reader.get_matched_publication_data(handle) for handle in reader.get_matched_publications()]
    # A publisher that has gone in between has no data, and the last sample of a participant that has gone no lease.
    found = [each for each in found if each is not None]
    heard = [each for each in participants.read(N=1000) if each.sample_info.valid_data]
    leases = {each.key: each.qos[Policy.Liveliness].lease_duration / 1e9 for each in heard}
    return {
        "offered": sorted({f"{each.qos[Policy.Reliability]} {each.qos[Policy.Durability]}" for each in found}),
        "leases_s": sorted({leases[each.participant_key] for each in found}),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--domain", type=int, default=0)
    parser.add_argument("--depth", type=int, default=100)
    parser.add_argument("--topic", action="append", default=[], help="topic:reliability:durability")
    parser.add_argument("--until-each", action="store_true")
    arguments = parser.parse_args()
    participant = DomainParticipant(arguments.domain)
    participants = BuiltinDataReader(participant, BuiltinTopicDcpsParticipant)
    readers = []
    for wanted in arguments.topic:
        kind, reliability, durability = (wanted.split(":") + ["reliable", "volatile"])[:3]
        name = f"rt/{kind}" if kind in ("diagnostics", "clock", "tf", "rosout") else f"rt/{arguments.name}/{kind}"
        topic = Topic(participant, name, TOPICS[kind])
        qos = quality(reliability, durability, arguments.depth)
        readers.append((wanted, kind, DataReader(participant, topic, qos=qos)))
    print(json.dumps({"type": "ready"}), flush=True)
    counts = {wanted: 0 for wanted, _, _ in readers}
    end = time.monotonic() + arguments.seconds
    while time.monotonic() < end:
        idle = True
        for wanted, kind, reader in readers:
            for sample in reader.take(N=100):
                # The notice that a publisher has gone comes as an empty sample.
                if not isinstance(sample, TOPICS[kind]):
                    continue
                idle = False
                counts[wanted] += 1
                if counts[wanted] == 1:
                    print(json.dumps({"type": "offered", "by": kind, **offered(reader, participants)}), flush=True)
                sent_ns = sample.sample_info.source_timestamp
                line = {"type": "message", "topic": wanted, "sent_ns": sent_ns, "received_ns": time.time_ns()}
                line["message"] = shortened(kind, sample)
                print(json.dumps(line), flush=True)
                if arguments.until_each and counts[wanted] == 1 and all(counts.values()):
                    end = min(end, time.monotonic() + 1.0)
        if idle:
            time.sleep(0.002)
    publishers = {wanted: len(reader.get_matched_publications()) for wanted, _, reader in readers}
    print(json.dumps({"type": "end", "counts": counts, "publishers": publishers}), flush=True)


if __name__ == "__main__":
    sys.exit(main())
