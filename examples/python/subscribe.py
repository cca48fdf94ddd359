"""Prints the head's place once a second: `pip install iceoryx2==0.10.0 numpy`, start a publisher, run this.

    python3 examples/python/subscribe.py [--name bench_dragon] [--seconds 10] [--json] [--light]

The frames are read in the memory that the publisher wrote: no data is copied. With --json every frame is a line. With
--light the frames are in single precision, which a scene offers with `precision = "f32"` in `[publish]`.
"""

import argparse
import json
import time

import iceoryx2 as iox2
import numpy as np
from bench_dragon_messages import (
    EVENTS,
    NO_BENCH,
    PLAYBACK,
    STATES,
    CollisionAlert,
    FrameHeader,
    HandlePose,
    HandlePose32,
    handles_of,
)

iox2.set_log_level(iox2.LogLevel.Fatal)


def wait_for(opening):
    """Opens a service as soon as its publisher has created it; exits if its messages have another layout."""
    while True:
        try:
            return opening()
        except iox2.PublishSubscribeOpenError as error:
            if "IncompatibleTypes" in str(error):
                raise SystemExit(
                    "the publisher's messages have another layout than bench_dragon_messages.py: "
                    "take that file from the publisher's version of bench-dragon"
                ) from error
            time.sleep(0.1)
        except iox2.EventOpenError:
            time.sleep(0.1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--json", action="store_true", help="a line for every frame and alert")
    parser.add_argument("--light", action="store_true", help="the frames in single precision")
    arguments = parser.parse_args()

    # The node and its ports stay inside this function: as globals they would leave stale files.
    node = iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)

    def service(suffix):
        return node.service_builder(iox2.ServiceName.new(f"{arguments.name}/{suffix}"))

    suffix, pose = ("poses32", HandlePose32) if arguments.light else ("poses", HandlePose)
    poses = wait_for(lambda: service(suffix).publish_subscribe(iox2.Slice[pose]).user_header(FrameHeader).open())
    subscriber = poses.subscriber_builder().create()
    tick = wait_for(lambda: service("tick").event().open()).listener_builder().create()
    try:
        alerts = service("alerts").publish_subscribe(CollisionAlert).open().subscriber_builder().create()
    except iox2.PublishSubscribeOpenError:
        alerts = None  # The scene has none.

    end = time.monotonic() + arguments.seconds
    printed = 0.0
    received = missed = 0
    run_id = sequence = None
    while time.monotonic() < end:
        tick.timed_wait(iox2.Duration.from_millis(200))
        while (sample := subscriber.receive()) is not None:
            header = sample.user_header().contents
            handles = handles_of(sample)
            # Another run is a publisher that was started again and counts its frames from the beginning.
            if header.run_id == run_id:
                missed += header.sequence - sequence - 1
            run_id, sequence = header.run_id, header.sequence
            received += 1
            if arguments.json:
                line = {
                    "type": "frame",
                    "sequence": header.sequence,
                    "tick": header.tick,
                    "sim_time": header.sim_time,
                    "state": STATES[header.state],
                    "playback": PLAYBACK[header.playback],
                    "epoch": header.epoch,
                    "handles": len(handles),
                    "head": [float(handles["x"][0]), float(handles["y"][0])],
                }
                if not arguments.light:
                    # The difference of the second link from 1.65 m shows if the content is complete.
                    line["link"] = float(np.hypot(handles["x"][2] - handles["x"][1], handles["y"][2] - handles["y"][1]))
                print(json.dumps(line), flush=False)
            elif time.monotonic() >= printed + 1.0:
                printed = time.monotonic()
                print(
                    f"t = {header.sim_time:8.3f} s  {STATES[header.state]:<11} "
                    f"head ({handles['x'][0]:+.3f}, {handles['y'][0]:+.3f}) m  {len(handles)} handles  missed {missed}",
                    flush=True,
                )
            sample.delete()
        while alerts is not None and (alert := alerts.receive()) is not None:
            message = alert.payload().contents
            if arguments.json:
                line = {
                    "type": "alert",
                    "tick": message.tick,
                    "level": message.level,
                    "event": EVENTS[message.event],
                    "event_time": message.event_time,
                    "event_benches": [
                        bench for bench in (message.event_bench_a, message.event_bench_b) if bench != NO_BENCH
                    ],
                }
                # JSON has no NaN.
                print(json.dumps({key: None if value != value else value for key, value in line.items()}))
            alert.delete()
    if arguments.json:
        print(json.dumps({"type": "end", "received": received, "missed": missed}))
    else:
        print(f"{received} frames received, {missed} missed.")


if __name__ == "__main__":
    main()
