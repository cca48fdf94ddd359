"""Reads a frame and an alert, knowing only names, sizes and the order of fields from the design.

    by_design.py --name NAME

Prints one JSON line for the newest frame and one for the alert in effect.
"""

import argparse
import ctypes
import json
import struct
import time

import iceoryx2 as iox2

FRAME_HEADER = struct.Struct("<6Q3d6I")
COLLISION_ALERT = struct.Struct("<3Q8d6I")
HANDLE_POSE = struct.Struct("<5d")


def opaque(name, version, size):
    """Returns `size` bytes that are aligned to eight, under a layout's name."""

    class Opaque(ctypes.Structure):
        _fields_ = [("words", ctypes.c_uint64 * (size // 8))]

        @classmethod
        def type_name(cls):
            return f"bench_dragon/{name}/{version}"

    return Opaque


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    arguments = parser.parse_args()
    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)

    def service(suffix):
        return node.service_builder(iox2.ServiceName.new(f"{arguments.name}/{suffix}"))

    pose, header, alert = opaque("HandlePose", 1, 40), opaque("FrameHeader", 2, 96), opaque("CollisionAlert", 2, 112)
    deadline = time.monotonic() + 40

    def opened(builder):
        while True:
            try:
                return builder().open().subscriber_builder().create()
            except iox2.PublishSubscribeOpenError as error:
                # If the disk is busy a service is incomplete for seconds.
                if not any(reason in str(error) for reason in ("DoesNotExist", "HangsInCreation")) or time.monotonic() > deadline:
                    raise
                time.sleep(0.1)

    frames = opened(lambda: service("poses").publish_subscribe(iox2.Slice[pose]).user_header(header))
    alerts = opened(lambda: service("alerts").publish_subscribe(alert))
    received = {}
    while len(received) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
        while (sample := frames.receive()) is not None:
            fields = FRAME_HEADER.unpack(bytes(sample.user_header().contents))
            count = sample.header.number_of_elements
            handles = (ctypes.c_char * (40 * count)).from_address(sample.payload_ptr).raw
            received["frame"] = {"fields": fields, "handles": list(HANDLE_POSE.iter_unpack(handles))}
            sample.delete()
        while (sample := alerts.receive()) is not None:
            received["alert"] = {"fields": COLLISION_ALERT.unpack(bytes(sample.payload().contents))}
            sample.delete()
    for kind, content in received.items():
        print(json.dumps({"type": kind, **content}))


if __name__ == "__main__":
    main()
