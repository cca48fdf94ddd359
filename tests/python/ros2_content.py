"""Compares one ROS 2 topic, bit for bit, with the shared memory of the same publisher.

    ros2_content.py --name NAME --seconds S --topic handles|poses --reliability reliable|best_effort

Reads the raw CDR, since decoding it in Python would be slower than the publisher. Prints one JSON line: the number of
messages, of sequences missing between the first and the last, of compared messages, and of those that differ.
"""

import argparse
import json
import struct
import time

import numpy as np
from cyclonedds._clayer import ddspy_take
from cyclonedds.core import InstanceState, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from ros2_peer import TOPICS, quality

# CDR: 4 bytes for little-endian, then sec, nanosec, and "stage" with its length.
STAMP = struct.Struct("<4xiI")
AFTER_HEADER = 4 + 24
# run_id to deadline_ns, three numbers, handles to reserved.
FRAME_HEADER = 6 * 8 + 3 * 8 + 6 * 4
ANY = SampleState.Any | ViewState.Any | InstanceState.Any


def of_handles(raw):
    """Returns stamp and handles (x, y, heading, vx, vy) of a HandlePoses."""
    # The frame header; then the length of the sequence, and four bytes that align its numbers.
    count = struct.unpack_from("<I", raw, AFTER_HEADER + FRAME_HEADER)[0]
    first = AFTER_HEADER + FRAME_HEADER + 8
    return np.frombuffer(raw, "<f8", 5 * count, first).reshape(count, 5)


def of_poses(raw):
    """Returns the positions of a PoseArray."""
    count = struct.unpack_from("<I", raw, AFTER_HEADER - 4)[0]
    return np.frombuffer(raw, "<f8", 7 * count, AFTER_HEADER).reshape(count, 7)[:, :2]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--topic", choices=("handles", "poses"), default="handles")
    parser.add_argument("--reliability", default="reliable")
    arguments = parser.parse_args()

    participant = DomainParticipant(0)
    topic = Topic(participant, f"rt/{arguments.name}/{arguments.topic}", TOPICS[arguments.topic])
    reader = DataReader(participant, topic, qos=quality(arguments.reliability, "volatile", depth=3000))
    # Only now: earlier messages over shared memory have no counterpart.
    shared = SharedMemory(arguments.name)
    frames = {}
    messages = {}
    end = None
    # S seconds from the first message, however late the publisher is discovered.
    while end is None or time.monotonic() < end:
        if end is None and messages:
            end = time.monotonic() + arguments.seconds
        frames.update(shared.take())
        for raw, _ in ddspy_take(reader._ref, ANY, 100):
            sec, nanosec = STAMP.unpack_from(raw)
            handles = of_handles(raw) if arguments.topic == "handles" else of_poses(raw)
            messages[sec * 1_000_000_000 + nanosec] = handles
        time.sleep(0.002)
    frames.update(shared.take())
    shared.close()

    both = sorted(frames[stamp][0] for stamp in messages if stamp in frames)
    different = 0
    for stamp, handles in messages.items():
        if stamp in frames:
            columns = handles.shape[1]
            different += not np.array_equal(handles, frames[stamp][1][:, :columns])
    missing = both[-1] - both[0] + 1 - len(both) if both else None
    print(json.dumps({"received": len(messages), "compared": len(both), "missing": missing, "different": different}))


class SharedMemory:
    """The frames of the shared memory by their stamp: sequence and handles."""

    def __init__(self, name):
        import iceoryx2 as iox2
        from bench_dragon import FrameHeader, HandlePose, handles_of

        iox2.set_log_level(iox2.LogLevel.Fatal)
        self._handles_of = handles_of
        self._node = (
            iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        )
        service = self._node.service_builder(iox2.ServiceName.new(f"{name}/poses"))
        self._subscriber = (
            service.publish_subscribe(iox2.Slice[HandlePose])
            .user_header(FrameHeader)
            .open()
            .subscriber_builder()
            .create()
        )

    def take(self):
        frames = {}
        while (sample := self._subscriber.receive()) is not None:
            header = sample.user_header().contents
            handles = self._handles_of(sample)
            flat = handles.view("<f8").reshape(len(handles), 5).copy()
            frames[header.stamp_ns] = (header.sequence, flat)
            sample.delete()
        return frames

    def close(self):
        del self._subscriber, self._node


if __name__ == "__main__":
    main()
