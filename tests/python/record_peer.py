"""Keeps all messages of an independent subscriber, and compares them with recordings of the same show.

    record_peer.py subscribe --name NAME --kept FILE
    record_peer.py compare --name NAME --kept FILE --recordings FILE...

`subscribe` prints `ready`, then `frame` at the first frame, and ends when a publisher has come and gone. FILE then
holds the bytes of every message. `compare` decodes every message of every topic of the recordings with
mcap-ros2-support, and the same files with rosbags. `compare` prints their number by topic, or fails.
"""

import argparse
import ctypes
import json
import math
import pathlib
import pickle
import time
from collections import Counter, defaultdict

import bench_dragon as messages

KINDS = {
    "stage": messages.Stage,
    "alerts": messages.CollisionAlert,
    "cues": messages.Cue,
    "status": messages.LoopStatus,
}
STANDARD = ("geometry_msgs", "nav_msgs", "std_msgs", "builtin_interfaces", "diagnostic_msgs", "visualization_msgs")
STANDARD += ("rosgraph_msgs", "tf2_msgs", "sensor_msgs")


def subscribe(name, kept):
    import iceoryx2 as iox2

    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    services, ports, got = {}, {}, defaultdict(list)

    def open_all():
        for kind in ["poses", *KINDS]:
            if kind in ports:
                continue
            builder = node.service_builder(iox2.ServiceName.new(f"{name}/{kind}"))
            if kind == "poses":
                builder = builder.publish_subscribe(iox2.Slice[messages.HandlePose]).user_header(messages.FrameHeader)
            elif kind == "stage":
                builder = builder.publish_subscribe(iox2.Slice[messages.StageSegment]).user_header(messages.Stage)
            else:
                builder = builder.publish_subscribe(KINDS[kind])
            try:
                services[kind] = builder.open()
                ports[kind] = services[kind].subscriber_builder().create()
            except iox2.PublishSubscribeOpenError:
                pass  # Not there yet.

    def take():
        for kind, port in ports.items():
            while (sample := port.receive()) is not None:
                if kind == "poses":
                    if not got["poses"]:
                        print("frame", flush=True)
                    count = sample.header.number_of_elements
                    handles = (ctypes.c_char * (40 * count)).from_address(sample.payload_ptr).raw
                    got["poses"].append((bytes(sample.user_header().contents), handles))
                elif kind == "stage":
                    # The header, and then the segments.
                    size = ctypes.sizeof(messages.StageSegment) * sample.header.number_of_elements
                    segments = (ctypes.c_char * size).from_address(sample.payload_ptr).raw
                    got[kind].append(bytes(sample.user_header().contents) + segments)
                else:
                    got[kind].append(bytes(sample.payload().contents))
                sample.delete()

    print("ready", flush=True)
    looked = 0.0
    while True:
        if time.monotonic() - looked > 0.1:
            looked = time.monotonic()
            open_all()
            # The last status is sent after the last frame.
            publishers = sum(service.dynamic_config.number_of_publishers for service in services.values())
            if got["poses"] and publishers == 0:
                break
        take()
        time.sleep(0.002)
    take()
    with open(kept, "wb") as file:
        pickle.dump(dict(got), file)


def same(decoded, expected, where):
    """Asserts that a decoded message has every field of a ctypes structure, bit for bit except for NaN."""
    for field, _ in expected._fields_:
        ours, theirs = getattr(expected, field), getattr(decoded, field)
        equal(theirs, ours, f"{where}.{field}")


def equal(decoded, expected, where):
    if isinstance(decoded, str):
        name = expected if isinstance(expected, bytes) else bytes(expected).rstrip(b"\0")
        assert decoded == name.decode(), f"{where}: {decoded}, expected {name}"
    elif hasattr(expected, "ELEMENT"):
        assert len(decoded) == len(expected), where
        for index, (theirs, ours) in enumerate(zip(decoded, expected)):
            equal(theirs, ours, f"{where}[{index}]")
    elif isinstance(expected, ctypes.Structure):
        same(decoded, expected, where)
    elif isinstance(expected, ctypes.Array):
        assert len(decoded) == len(expected), where
        for index, (theirs, ours) in enumerate(zip(decoded, expected)):
            equal(theirs, ours, f"{where}[{index}]")
    elif isinstance(expected, float) and math.isnan(expected):
        assert math.isnan(decoded), f"{where}: {decoded} is a number"
    else:
        assert decoded == expected, f"{where}: {decoded}, expected {expected}"


def stamped(message, stamp_ns, where):
    header = message.header
    assert header.stamp.sec * 10**9 + header.stamp.nanosec == stamp_ns, where
    assert header.frame_id == "stage", where


def at(pose, handle, where):
    """Asserts that a pose has the place and heading of a handle."""
    position, turn = pose.position, pose.orientation
    assert (position.x, position.y, position.z) == (handle.x, handle.y, 0.0), where
    assert (turn.x, turn.y) == (0.0, 0.0) and turn.w >= 0.0, where
    assert abs(math.remainder(2 * math.atan2(turn.z, turn.w) - handle.heading, math.tau)) < 1e-14, where


class Comparison:
    def __init__(self, kept, name):
        self.name = name
        self.frames = [
            (
                messages.FrameHeader.from_buffer_copy(header),
                (messages.HandlePose * (len(poses) // 40)).from_buffer_copy(poses),
            )
            for header, poses in kept["poses"]
        ]
        self.by_stamp = {header.stamp_ns: (header, handles) for header, handles in self.frames}
        self.events = {kind: [of.from_buffer_copy(raw) for raw in kept.get(kind, [])] for kind, of in KINDS.items()}
        segments = [raw[ctypes.sizeof(messages.Stage) :] for raw in kept.get("stage", [])]
        count = [len(raw) // ctypes.sizeof(messages.StageSegment) for raw in segments]
        self.segments = [(messages.StageSegment * n).from_buffer_copy(raw) for n, raw in zip(count, segments)]
        self.seen, self.counts, self.first = defaultdict(list), Counter(), None

    def message(self, topic, stamp_ns, sequence, message):
        self.counts[topic] += 1
        kind = topic.removeprefix(f"/{self.name}/")
        if kind not in KINDS and kind not in ("/diagnostics", "path"):
            self.first = self.first or stamp_ns
            if stamp_ns < self.frames[0][0].stamp_ns:
                return  # A process that polls more often has a publisher's first frames.
        index = len(self.seen[topic])
        self.seen[topic].append(stamp_ns)
        where = f"{topic} {index}"
        if kind in KINDS:
            expected = self.events[kind][index]
            assert stamp_ns == expected.stamp_ns, where
            stamped(message, stamp_ns, where)
            same(message, expected, where)
            if kind == "stage":
                equal(message.segments, self.segments[index], f"{where}.segments")
        elif kind in ("/diagnostics", "path"):
            getattr(self, kind.strip("/"))(message, index, stamp_ns, where)
        else:
            header, handles = self.by_stamp[stamp_ns]
            assert sequence == header.sequence & 0xFFFFFFFF, where
            getattr(self, kind.strip("/"))(message, header, handles, where)

    def handles(self, message, header, handles, where):
        stamped(message, header.stamp_ns, where)
        same(message, header, where)
        equal(message.poses, handles, where)

    def poses(self, message, header, handles, where):
        stamped(message, header.stamp_ns, where)
        assert len(message.poses) == len(handles), where
        for pose, handle in zip(message.poses, handles):
            at(pose, handle, where)

    def clock(self, message, header, handles, where):
        assert abs(message.clock.sec + message.clock.nanosec / 1e9 - header.sim_time) < 1e-6, where

    def tf(self, message, header, handles, where):
        ends = {f"{self.name}/head": handles[0], f"{self.name}/tail": handles[-1]}
        assert [transform.child_frame_id for transform in message.transforms] == list(ends), where
        for transform, handle in zip(message.transforms, ends.values()):
            stamped(transform, header.stamp_ns, where)
            translation = transform.transform.translation
            assert (translation.x, translation.y, translation.z) == (handle.x, handle.y, 0.0), where

    def markers(self, message, header, handles, where):
        benches = [marker for marker in message.markers if marker.ns == "benches"]
        assert len(benches) == len(handles) - 1, where
        for marker, front, rear in zip(benches, handles, handles[1:]):
            stamped(marker, header.stamp_ns, where)
            position = marker.pose.position
            middle = (front.x + rear.x) / 2, (front.y + rear.y) / 2
            assert math.dist((position.x, position.y), middle) < 1e-12, where

    def diagnostics(self, message, index, stamp_ns, where):
        status = self.events["status"][index]
        assert stamp_ns == status.stamp_ns, where
        stamped(message, stamp_ns, where)
        loop, dragon = message.status
        assert (loop.hardware_id, loop.name, dragon.name) == (self.name, f"{self.name}: loop", f"{self.name}: dragon")
        values = {pair.key: pair.value for pair in loop.values}
        assert int(values["skipped periods"]) == status.skipped, where
        before = self.events["status"][index - 1] if index else None
        # Each run begins without a skip.
        before = before.skipped if before and before.run_id == status.run_id else 0
        # A tenth of a second's periods is an error, by default.
        skipped, error = status.skipped - before, max(2, math.ceil(0.1 * status.rate))
        assert loop.level == (2 if skipped >= error else 1 if skipped > 0 else 0), (where, loop.level, skipped)
        values = {pair.key: pair.value for pair in dragon.values}
        assert values["sim_time (s)"] == f"{status.sim_time:.3f}", where

    def path(self, message, index, stamp_ns, where):
        stage = self.events["stage"][index]
        assert stamp_ns == stage.stamp_ns and len(message.poses) > 100, where
        for pose in message.poses:
            x, y = pose.pose.position.x, pose.pose.position.y
            turns = math.hypot(x, y) / stage.dragons[0].pitch
            off = math.remainder(math.atan2(y, x) / math.tau - turns, 1.0)
            assert abs(off) < 1e-9 or math.hypot(x, y) < 1e-9, (where, off)


def compare(name, kept, recordings):
    from blake3 import blake3
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with open(kept, "rb") as file:
        comparison = Comparison(pickle.load(file), name)
    profiles, sizes = set(), []
    for recording in recordings:
        with open(recording, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
            profiles.add(reader.get_header().profile)
            times = []
            for schema, channel, raw, message in reader.iter_decoded_messages(log_time_order=False):
                assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg"), channel
                assert "offered_qos_profiles" in channel.metadata, channel
                times.append(raw.log_time)
                comparison.message(channel.topic, raw.publish_time, raw.sequence, message)
            attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
            attached = json.loads(attachments["bench_dragon.json"])
            scene_hash = bytes(comparison.events["stage"][0].scene_hash)
            assert blake3(attachments["scene.toml"]).digest() == scene_hash, "another scene than the show's"
            dragon = comparison.events["stage"][0].dragons[0]
            assert attached["name"] == name and attached["stage"]["dragons"][0]["benches"] == dragon.benches
            assert int(attached["run_id"]) == comparison.frames[0][0].run_id
            assert min(times) >= comparison.first, "a time before all frames"
            sizes.append(len(times))
    assert profiles == {"ros2"}, profiles
    stamps = [header.stamp_ns for header, _ in comparison.frames if header.stamp_ns >= comparison.first]
    assert stamps[0] - comparison.first < 10**9 and len(stamps) > len(comparison.frames) - 50, "another beginning"
    for topic, seen in comparison.seen.items():
        kind = topic.removeprefix(f"/{name}/")
        if kind in KINDS:
            assert len(seen) == len(comparison.events[kind]), (topic, len(seen), len(comparison.events[kind]))
        elif kind in ("markers", "/tf"):
            # Both begin with the stage, for which a subscriber may have to wait.
            assert len(seen) > len(stamps) / 2 and seen == stamps[-len(seen) :], f"{len(seen)} of {len(stamps)} {kind}"
        elif kind not in ("/diagnostics", "path"):
            assert seen == stamps, f"{topic}: {len(seen)} of {len(stamps)} frames"
    assert with_rosbags(recordings, sizes) == comparison.counts, "rosbags counts otherwise"
    print(json.dumps(comparison.counts))


def with_rosbags(recordings, sizes):
    """Opens the recordings alone, reads every message, and compares the definitions of the standard types."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    known = get_typestore(Stores.ROS2_JAZZY).fielddefs
    counts = Counter()
    for recording, size in zip(recordings, sizes):
        with AnyReader([pathlib.Path(recording)]) as reader:
            for connection, _, raw in reader.messages():
                message = reader.deserialize(raw, connection.msgtype)
                assert message.__msgtype__ == connection.msgtype
                counts[connection.topic] += 1
            for of, (_, fields) in reader.typestore.fielddefs.items():
                if of.split("/")[0] in STANDARD:
                    assert fields == known[of][1], f"{of}: {fields}, expected {known[of][1]}"
        check_metadata(recording)
    assert sum(counts.values()) == sum(sizes)
    return counts


def check_metadata(recording):
    """Checks what `ros2 bag info` reads besides statistics and channels: rosbag2's metadata, version 8."""
    from mcap.reader import make_reader
    from ruamel.yaml import YAML

    with open(recording, "rb") as file:
        [metadata] = make_reader(file).iter_metadata()
    assert metadata.name == "rosbag2" and list(metadata.metadata) == ["serialized_metadata"], metadata
    fields = YAML(typ="safe").load(metadata.metadata["serialized_metadata"])
    assert fields["version"] == 8 and fields["storage_identifier"] == "mcap" and fields["ros_distro"] == "jazzy", fields
    # rosbag2 reads all of these, of these types.
    lists = ("relative_file_paths", "topics_with_message_count", "files")
    assert [type(fields[field]) for field in lists] == [list] * 3
    assert fields["compression_format"] == fields["compression_mode"] == "" and fields["custom_data"] is None
    assert fields["duration"] == {"nanoseconds": 0} and fields["starting_time"] == {"nanoseconds_since_epoch": 0}
    assert fields["message_count"] == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["subscribe", "compare"])
    parser.add_argument("--name", required=True)
    parser.add_argument("--kept", required=True)
    parser.add_argument("--recordings", nargs="+")
    arguments = parser.parse_args()
    if arguments.what == "subscribe":
        subscribe(arguments.name, arguments.kept)
    else:
        compare(arguments.name, arguments.kept, arguments.recordings)


if __name__ == "__main__":
    main()
