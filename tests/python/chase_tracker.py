"""Passes the trackers of one show to the chase of another, with noise and dropouts, and compares their heads.

    chase_tracker.py --leader NAME --follower NAME --from PORT --to PORT --seconds S --result FILE

The leader's `send psn` sends to the first port, the follower's `chase psn` listens at the second. The leader stands at
first. Packets are passed until S seconds after the start of both. Writes a JSON object with the distances of the
follower's head from the leader's along the path, from 4 s after the start of both.
"""

import argparse
import bisect
import json
import pathlib
import random
import socket
import struct
import sys
import time

sys.path.append(str(pathlib.Path(__file__).resolve().parent))
from chase_sender import Frames, percentile  # noqa: E402

# Seconds within which both shows move.
PATIENCE = 1800


def start(frames):
    """Returns the time of a show's first frame at another simulated time than the first one's, seconds, or None."""
    moved = (header for header in frames.headers if header[1] != frames.headers[0][1])
    return next((header[0] * 1e-9 for header in moved), None)


def noisy(packet, sigma):
    """Returns a packet with noise on the position of its only tracker: the first chunk of 12 bytes with the id 0."""
    header = struct.pack("<I", 12 << 16)
    # The packet's own header is a chunk of 12 bytes with the id 0, too.
    at = packet.index(header, packet.index(header) + 4 + 12) + 4
    position = [value + random.gauss(0, sigma) for value in struct.unpack_from("<fff", packet, at)]
    return packet[:at] + struct.pack("<fff", *position) + packet[at + 12 :]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--leader", required=True)
    parser.add_argument("--follower", required=True)
    parser.add_argument("--from", type=int, required=True, dest="port")
    parser.add_argument("--to", type=int, required=True)
    parser.add_argument("--seconds", type=float, required=True)
    parser.add_argument("--result", required=True)
    arguments = parser.parse_args()
    random.seed(2)
    leader, follower = Frames(arguments.leader), Frames(arguments.follower)
    leader.start()
    follower.start()
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", arguments.port))
    sock.settimeout(60)
    packet = sock.recv(65536)
    started, ends = time.monotonic(), None
    # A busy machine starts the chase late.
    while (now := time.monotonic()) < (ends or started + PATIENCE):
        since = now - started
        if ends is None and start(leader) and start(follower):
            ends = now + arguments.seconds
        # A dropout of half a second every four seconds, and one packet in twenty.
        is_data = struct.unpack_from("<H", packet)[0] == 0x6755
        if is_data and since % 4 < 3.5 and random.random() > 0.05:
            sock.sendto(noisy(packet, 0.15), ("127.0.0.1", arguments.to))
        packet = sock.recv(65536)
    for frames in (leader, follower):
        frames.stop = True
        frames.join()
    assert ends, f"{start(leader)}, {start(follower)}: both shows do not move within {PATIENCE} s"
    times = [header[0] for header in leader.headers]
    begin = max(start(leader), start(follower)) + 4
    distances, epochs = [], set()
    for deadline_ns, sim_time, _, epoch, _ in follower.headers:
        if not begin <= deadline_ns * 1e-9 < ends:
            continue
        place = bisect.bisect(times, deadline_ns) - 1
        moment, leading, rate, _, _ = leader.headers[place]
        # The paper's head moves at 1 m/s: a second of simulated time is a metre.
        distances.append(abs(sim_time - (leading + rate * (deadline_ns - moment) * 1e-9)))
        epochs.add(epoch)
    result = {"frames": len(distances), "p99": percentile(distances, 0.99), "p50": percentile(distances, 0.5), "max": max(distances), "epochs": len(epochs)}
    pathlib.Path(arguments.result).write_text(json.dumps(result))


if __name__ == "__main__":
    main()
