#!/usr/bin/env python3
"""Latency from sending to receiving: the live publisher beside a bare iceoryx2 publisher of the same payload.

Both send 224 handles and a header of 80 bytes 1,000 times a second to one subscriber, which waits on the event. They
run in turn, for some rounds, so that changes of the machine's load affect both. Needs:

    cargo build --release && cargo build --release --example bare
    python3 benches/latency.py [--seconds 20] [--rounds 3]
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import time

TARGET = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "target", "release")
NAME = f"latency_{os.getpid()}"
PERCENTILES = ("p50", "p99", "p999")


def bare(seconds):
    program = os.path.join(TARGET, "examples", "bare")
    publisher = subprocess.Popen([program, "publish", NAME, str(seconds + 2)])
    time.sleep(1)
    said = subprocess.run([program, "subscribe", NAME, str(seconds)], stdout=subprocess.PIPE, check=True).stdout
    publisher.wait()
    return json.loads(said)


def live(seconds):
    program = [os.path.join(TARGET, "bench-dragon"), "--name", NAME]
    run = ["run", "--rate", "1000", "--duration", str(seconds + 4), "--json"]
    publisher = subprocess.Popen(program + run, stdout=subprocess.DEVNULL)
    time.sleep(1.5)
    subscriber = subprocess.Popen(program + ["soak-subscriber"], stdout=subprocess.PIPE)
    time.sleep(seconds)
    subscriber.send_signal(signal.SIGTERM)
    said = subscriber.communicate()[0].splitlines()[-1]
    publisher.wait()
    seen = json.loads(said)
    return {"received": seen["received"], **seen["total"]["since_sent"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    print(f"{'round':>5} {'':<6} {'received':>9}" + "".join(f"{name + ', us':>12}" for name in PERCENTILES))
    rounds = {"bare": [], "live": []}
    for number in range(1, arguments.rounds + 1):
        for name, measure in (("bare", bare), ("live", live)):
            found = measure(arguments.seconds)
            rounds[name].append(found)
            figures = "".join(f"{found[percentile] / 1000:12.1f}" for percentile in PERCENTILES)
            print(f"{number:>5} {name:<6} {found['received']:>9}{figures}", flush=True)
    median = {
        name: {percentile: statistics.median(one[percentile] for one in found) for percentile in PERCENTILES}
        for name, found in rounds.items()
    }
    ratios = "".join(f"{median['live'][percentile] / median['bare'][percentile]:12.2f}" for percentile in PERCENTILES)
    print(f"medians: live / bare   {ratios}")


if __name__ == "__main__":
    main()
