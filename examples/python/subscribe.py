"""Prints the head's place once a second: `pip install iceoryx2==0.10.0 numpy`, start a publisher, run this.

    python3 examples/python/subscribe.py [--name bench_dragon] [--seconds 10] [--json] [--light]

The frames are read in the memory that the publisher wrote: no data is copied. With --json every frame is a line. With
--light the frames are in single precision, which a scene offers with `precision = "f32"` in `[publish]`.
"""

import argparse
import json
import time

import numpy as np
from bench_dragon import EVENTS, NO_BENCH, PLAYBACK, STATES, LayoutError, subscribe


def frame_line(header, handles, light):
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
    if not light:
        # The difference of the second link from 1.65 m shows if the content is complete.
        line["link"] = float(np.hypot(handles["x"][2] - handles["x"][1], handles["y"][2] - handles["y"][1]))
    return line


def alert_line(alert):
    line = {
        "type": "alert",
        "tick": alert.tick,
        "level": alert.level,
        "event": EVENTS[alert.event],
        "event_time": alert.event_time,
        "event_benches": [bench for bench in (alert.event_bench_a, alert.event_bench_b) if bench != NO_BENCH],
    }
    # JSON has no NaN.
    return {key: None if value != value else value for key, value in line.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--json", action="store_true", help="a line for every frame and alert")
    parser.add_argument("--light", action="store_true", help="the frames in single precision")
    arguments = parser.parse_args()
    printed = 0.0
    received = missed = 0
    with subscribe(arguments.name, light=arguments.light, seconds=arguments.seconds) as feed:
        for frame in feed:
            header, handles = frame.header, frame.handles
            received += 1
            missed += frame.missed
            if arguments.json:
                print(json.dumps(frame_line(header, handles, arguments.light)))
                for alert in feed.alerts():
                    print(json.dumps(alert_line(alert)))
            elif time.monotonic() >= printed + 1.0:
                printed = time.monotonic()
                print(
                    f"t = {header.sim_time:8.3f} s  {STATES[header.state]:<11} "
                    f"head ({handles['x'][0]:+.3f}, {handles['y'][0]:+.3f}) m  {len(handles)} handles  missed {missed}",
                    flush=True,
                )
    if arguments.json:
        print(json.dumps({"type": "end", "received": received, "missed": missed}))
    else:
        print(f"{received} frames received, {missed} missed.")


if __name__ == "__main__":
    try:
        main()
    except LayoutError as error:
        raise SystemExit(str(error)) from error
