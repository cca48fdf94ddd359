"""Compares the frames of `<name>/poses32` with those of `<name>/poses`, number by number, until the publisher leaves.

    light_peer.py --name NAME [--teams HANDLES...]

Prints "ready" once it looks for the publisher, and "enough" when it has five seconds of frames at 50 Hz. At the end it
prints a JSON line with the counts. Ends with an error if a frame is not its counterpart rounded.
"""

import argparse
import json
import time

import iceoryx2 as iox2
import numpy as np

from bench_dragon import FrameHeader, HandlePose, HandlePose32, handles_of, indices_of

# Each message has its own sending time and its own count.
OF_THE_FRAME = [name for name, _ in FrameHeader._fields_ if name not in ("sent_ns", "handles")]


def open_service(node, name, pose):
    builder = lambda: node.service_builder(iox2.ServiceName.new(name)).publish_subscribe(iox2.Slice[pose])
    while True:
        try:
            return builder().user_header(FrameHeader).open()
        except iox2.PublishSubscribeOpenError:
            time.sleep(0.05)


def take(port, into):
    """Copies all waiting messages: the header and the poses of each frame, by sequence."""
    while (sample := port.receive()) is not None:
        header = sample.user_header().contents
        poses = handles_of(sample).copy()
        assert header.handles == len(poses), f"the header says {header.handles}, there are {len(poses)}"
        into[header.sequence] = [repr(getattr(header, field)) for field in OF_THE_FRAME], poses
        sample.delete()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", required=True)
    parser.add_argument("--teams", type=int, nargs="+", help="handles of each dragon, if there are several")
    name, teams = (arguments := parser.parse_args()).name, arguments.teams
    iox2.set_log_level(iox2.LogLevel.Fatal)
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
    print("ready")
    services = [open_service(node, f"{name}/poses", HandlePose), open_service(node, f"{name}/poses32", HandlePose32)]
    ports = [service.subscriber_builder().create() for service in services]
    frames, is_enough = [{}, {}], False
    while not frames[0] or services[0].dynamic_config.number_of_publishers > 0:
        list(map(take, ports, frames))
        if not is_enough and min(map(len, frames)) >= 250:
            is_enough = True
            print("enough")
        time.sleep(0.01)
    list(map(take, ports, frames))

    whole, light = frames
    # One of the two ports was connected first.
    first = max(min(whole), min(light))
    assert sorted(light) == list(range(min(light), max(whole) + 1)), "frames are missing"
    compared = [sequence for sequence in whole if sequence >= first]
    handles = set()
    for sequence in compared:
        (header, poses), (header_32, poses_32) = whole[sequence], light[sequence]
        assert header == header_32, f"{header} and {header_32}"
        handles = indices_of(services[1], *(teams or [len(poses)]))
        for field in poses.dtype.names:
            rounded = poses[field][handles].astype(np.float32)
            same = rounded.view(np.uint32) == poses_32[field].view(np.uint32)
            assert same.all(), f"frame {sequence}: {field} of handles {handles[~same]}"
    print(json.dumps({"compared": len(compared), "last": max(light), "handles": [int(handle) for handle in handles]}))


if __name__ == "__main__":
    main()
