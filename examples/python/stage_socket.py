"""Reads the stage picture's WebSocket, as a visualiser on any machine can: `pip install websockets==17.4`.

    stage_socket.py [--url ws://127.0.0.1:8080/frames] [--rate HZ] [--seconds S]

Prints the stage and the alerts as they come and the head's place once a second. Start `bench-dragon run` and
`bench-dragon view` first.
"""

import argparse
import json
import math
import struct
import time

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

VERSION = 3
HEADER = struct.Struct("<BBBxI d d Q Q Q Q f I I 4x")
HANDLE = struct.Struct("<5f")
PLAYBACK = ["playing", "paused", "held", "ended"]


def frame(message):
    """Returns the header as a dictionary and one (x, y, heading, vx, vy) for each handle."""
    if message[0] != VERSION:
        raise SystemExit(f"the server speaks version {message[0]} of the layout, this program version {VERSION}")
    (
        _,
        state,
        playback,
        handles,
        sim_time,
        time_scale,
        sequence,
        run_id,
        sent_ns,
        tick,
        clearance,
        epoch,
        cue,
    ) = HEADER.unpack_from(message)
    header = {
        "state": state,
        "handles": handles,
        "sim_time": sim_time,
        "time_scale": time_scale,
        "sequence": sequence,
        "run_id": run_id,
        "sent_ns": sent_ns,
        "tick": tick,
        "clearance": clearance,
        "playback": PLAYBACK[playback],
        "epoch": epoch,
        "cue": cue,
    }
    return header, list(HANDLE.iter_unpack(memoryview(message)[HEADER.size :]))


def follow(socket, deadline):
    printed, states = 0.0, []
    for message in socket:
        if isinstance(message, str):
            message = json.loads(message)
            print(message, flush=True)
            # The states, and the severity of each. The first frames may come before the stage.
            states = message["states"] if message["type"] == "stage" else states
        else:
            header, handles = frame(message)
            if states and time.monotonic() - printed >= 1:
                printed = time.monotonic()
                x, y, _, vx, vy = handles[0]
                name = states[header["state"]]["name"]
                print(f"t = {header['sim_time']:8.3f} s  {name:11} head ({x:.3f}, {y:.3f}) m  {math.hypot(vx, vy):.3f} m/s", flush=True)
        if time.monotonic() > deadline:
            return


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--url", default="ws://127.0.0.1:8080/frames")
    parser.add_argument("--rate", type=float, default=60, help="greatest number of frames a second")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    options = parser.parse_args()
    deadline = time.monotonic() + options.seconds
    url = f"{options.url}{'&' if '?' in options.url else '?'}rate={options.rate}"
    while time.monotonic() < deadline:
        try:
            with connect(url, compression=None, max_queue=1) as socket:
                follow(socket, deadline)
        except InvalidStatus as error:
            raise SystemExit(f"{url}: {error.response.body.decode(errors='replace').strip()}")
        except (OSError, ConnectionClosed) as error:
            print(f"no server: {error}; trying again", flush=True)
            time.sleep(1)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
