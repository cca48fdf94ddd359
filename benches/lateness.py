#!/usr/bin/env python3
"""Wake-up lateness: the live loop beside cyclictest, on the same core, at the same interval and priority.

The two run in turn, for some rounds, so that changes of the machine's load affect both. Each runs once with CPUs that
may sleep and once with CPUs that are kept awake. The options for this are cyclictest --latency and bench-dragon run
--cpu-latency. By default cyclictest keeps CPUs awake. It is Debian's package rt-tests; real-time priority and waking
CPUs need root. The option --priority 0 compares without a priority. The live loop also counts the periods that a late
wake-up delayed (coordinated omission). But cyclictest counts only the wake-up, which is to its advantage. Needs:

    apt-get install rt-tests && cargo build --release
    python3 benches/lateness.py [--seconds 20] [--rounds 3] [--cpu 1] [--priority 80] [--interval-us 1000]
"""

import argparse
import json
import os
import re
import statistics
import subprocess

TARGET = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "target", "release")
NAME = f"lateness_{os.getpid()}"
# Microseconds that a CPU may take to wake up: a limit that every sleep state meets, and one that none meets.
CPU_LATENCIES = (("may sleep", 1_000_000), ("awake", 0))
PERCENTILES = (("p50", 0.5), ("p99", 0.99), ("p999", 0.999))
# Lateness beyond this many microseconds is only counted by cyclictest.
LONGEST_US = 100_000


def cyclictest(arguments, cpu_latency):
    command = ["cyclictest", "--mlockall", "--quiet", "--threads=1", f"--affinity={arguments.cpu}"]
    loops = int(arguments.seconds * 1e6 / arguments.interval_us)
    command += [f"--interval={arguments.interval_us}", f"--loops={loops}"]
    command += [f"--histogram={LONGEST_US}", f"--latency={cpu_latency}"]
    command += [f"--priority={arguments.priority}"] if arguments.priority else ["--policy=other"]
    said = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    histogram = [tuple(map(int, line.split())) for line in said.splitlines() if re.match(r"\d{6} \d+", line)]
    beyond = int(re.search(r"Histogram Overflows: (\d+)", said).group(1))
    total = sum(count for _, count in histogram) + beyond
    found = {"max": int(re.search(r"Max Latencies: (\d+)", said).group(1))}
    for name, quantile in PERCENTILES:
        seen, found[name] = 0, float("inf")
        for microseconds, count in histogram:
            seen += count
            if seen >= quantile * total:
                found[name] = microseconds
                break
    return found


def live(arguments, cpu_latency):
    command = [os.path.join(TARGET, "bench-dragon"), "--name", NAME]
    command += ["run", "--json", "--duration", str(arguments.seconds)]
    command += ["--rate", str(1e6 / arguments.interval_us), "--cpu", str(arguments.cpu)]
    command += ["--cpu-latency", str(cpu_latency)]
    command += ["--realtime", str(arguments.priority)] if arguments.priority else []
    said = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    return {name: value / 1000 for name, value in json.loads(said)["wakeup_ns"].items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--cpu", type=int, default=1)
    parser.add_argument("--priority", type=int, default=80)
    parser.add_argument("--interval-us", type=int, default=1000)
    arguments = parser.parse_args()
    names = [name for name, _ in PERCENTILES] + ["max"]
    print(f"{'round':>5} {'CPUs':<10} {'':<11}" + "".join(f"{name + ', us':>12}" for name in names))
    rounds = {}
    for number in range(1, arguments.rounds + 1):
        for sleep, cpu_latency in CPU_LATENCIES:
            for label, measure in (("cyclictest", cyclictest), ("live", live)):
                found = measure(arguments, cpu_latency)
                rounds.setdefault((sleep, label), []).append(found)
                figures = "".join(f"{found[name]:12.1f}" for name in names)
                print(f"{number:>5} {sleep:<10} {label:<11}{figures}", flush=True)
    for sleep, _ in CPU_LATENCIES:
        median = {
            label: {name: statistics.median(one[name] for one in rounds[sleep, label]) for name in names}
            for label in ("cyclictest", "live")
        }
        ratios = "".join(f"{median['live'][name] / max(median['cyclictest'][name], 1):12.2f}" for name in names)
        print(f"      {sleep:<10} live / cyc. {ratios[1:]}   (medians of the rounds)")


if __name__ == "__main__":
    main()
