"""Interpolates a publisher's frames at random times of display, as the examples for Python do.

    display_times.py --transport iceoryx2|ros2 --name NAME --moments N --delay D

Prints a JSON line for each time until N of them were between two frames. A line has the simulated time, the interval of
the frames on both sides, the places and the headings. The interval is longer if the publisher skipped some frames.
"""

import argparse
import bisect
import json
import pathlib
import random
import sys
import time

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "examples" / "python"))

from bench_dragon import HermiteReader, subscribe  # noqa: E402
import ros2_display  # noqa: E402


# No wait here lasts forever.
WATCHDOG = 250.0


def shared_memory_frames(name, seconds):
    end = time.monotonic() + seconds
    with subscribe(name) as feed:
        while time.monotonic() < end:
            while (frame := feed.poll()) is not None:
                yield frame.header, frame.handles
            yield None


def ros2_frames(name, seconds):
    import ros2_peer as peer
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    topic = Topic(DomainParticipant(0), f"rt/{name}/handles", peer.TOPICS["handles"])
    reader = DataReader(topic.participant, topic, qos=peer.quality("reliable", "volatile"))
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for sample in reader.take(N=100):
            if isinstance(sample, peer.TOPICS["handles"]):
                yield sample, ros2_display.handles_of(sample)
        yield None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--transport", choices=["iceoryx2", "ros2"], required=True)
    parser.add_argument("--name", required=True)
    parser.add_argument("--moments", type=int, required=True)
    parser.add_argument("--delay", type=float, required=True)
    arguments = parser.parse_args()
    frames = {"iceoryx2": shared_memory_frames, "ros2": ros2_frames}[arguments.transport]
    shown, chance, reader, count, between = [], random.Random(7), HermiteReader(), 0, 0
    for frame in frames(arguments.name, WATCHDOG):
        if between >= arguments.moments:
            break
        if frame is not None:
            reader.push(*frame)
            shown.append(float(frame[0].sim_time))
            count += 1
        elif count > 2:
            time.sleep(chance.uniform(0.001, 0.02))
            moment, handles = reader.at(time.monotonic_ns() - int(1e9 * arguments.delay))
            between += moment not in shown
            after = min(max(bisect.bisect(shown, moment), 1), count - 1)
            line = {"time": float(moment), "interval": shown[after] - shown[after - 1]}
            line |= {field: handles[field].tolist() for field in ("x", "y", "heading")}
            print(json.dumps(line))
        else:
            time.sleep(0.001)


if __name__ == "__main__":
    main()
