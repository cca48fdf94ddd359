"""Prints the head's place 20 times a second, at any publisher's rate, by the interpolation of `HermiteReader`.

    python3 examples/python/hermite.py [--name bench_dragon] [--seconds 10] [--delay 0.1] [--other-machine]
"""

import argparse
import time

from bench_dragon import HermiteReader, subscribe


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--delay", type=float, default=0.1, help="seconds behind the present: a period and a little")
    parser.add_argument("--other-machine", action="store_true", help="frames come by a tunnel: use their arrival time")
    arguments = parser.parse_args()
    reader = HermiteReader()
    end = time.monotonic() + arguments.seconds
    with subscribe(arguments.name) as feed:
        while time.monotonic() < end:
            while (frame := feed.poll()) is not None:
                reader.push(frame.header, frame.handles, time.monotonic_ns() if arguments.other_machine else None)
            shown = reader.at(time.monotonic_ns() - int(1e9 * arguments.delay))
            if shown is not None:
                moment, handles = shown
                print(f"t = {moment:9.4f} s  head ({handles['x'][0]:+.4f}, {handles['y'][0]:+.4f}) m", flush=True)
            time.sleep(0.05)


if __name__ == "__main__":
    main()
