#!/usr/bin/env python3
"""Cost of a second and a tenth dragon: publishers under different names on one machine, all read by one `metrics`.

For each rate, one, two and ten publishers of the same scene run in turn. The turns last some rounds, so that changes of
the machine's load affect all. Measured of each publisher: CPU time and resident memory, the lateness of its loop,
skipped periods, and frames that the reader missed. Prints medians over publishers and rounds, sums for skipped and
missed, and beside each the ratio to one publisher alone. The load of the machine is printed above: other programs
affect all figures. Needs:

    cargo build --release
    python3 benches/several.py [--seconds 15] [--rounds 3] [--counts 1,2,10] [--rates 60,1000] [--scene FILE]

With --one-show N in place of --scene, each publisher has one show of N dragons of 223 benches, with alerts. The dragons
coil into each other in pairs. Example: --one-show 16 --counts 1 --rates 60 --rounds 1 --seconds 60.
"""

import argparse
import json
import os
import re
import signal
import statistics
import subprocess
import tempfile
import time
import urllib.request

PROGRAM = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "target", "release", "bench-dragon")
# Time until tables are made and every service is connected.
WARM_UP = 4
# Start of a show of several, simulated seconds: both teams of a pair are in the coil.
START = 100
DRAGON = """
[[dragons]]
name = "d{number}"
placement = {{ origin = [{x}.0, {y}.0], rotation_turns = {turns} }}
[dragons.team]
benches = 223
head_length = 3.41
body_length = 2.20
width = 0.30
hole_inset = 0.275
[dragons.path]
kind = "spiral"
pitch = 1.7
start_turn = 8
[dragons.motion]
head_speed = 1.0
"""
COLUMNS = ("cpu", "memory", "step", "p50", "p99", "max")


def one_show(count):
    """Returns the scene of dragons that coil in pairs, 300 m from each other."""
    place = lambda number: {"x": 300 * (number // 2 % 4), "y": 300 * (number // 8), "turns": 0.5 * (number % 2)}
    return "[alerts]\n" + "".join(DRAGON.format(number=number, **place(number)) for number in range(count))


def cpu_seconds(process):
    """Returns user and system time of a process so far: proc(5), fields 14 and 15."""
    with open(f"/proc/{process.pid}/stat", encoding="ascii") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_mb(process):
    with open(f"/proc/{process.pid}/status", encoding="ascii") as file:
        return int(re.search(r"VmRSS:\s+(\d+)", file.read()).group(1)) / 1024


def missed(url):
    """Returns the frames that the reader has received and missed, over all names."""
    with urllib.request.urlopen(url) as answer:
        text = answer.read().decode()
    count = lambda what: sum(float(value) for value in re.findall(rf"^bench_dragon_metrics_frames_{what}_total\{{.*\}} (\S+)$", text, re.M))
    return count("received"), count("missed")


def round_of(count, rate, arguments):
    names = [f"several_{os.getpid()}_{place}" for place in range(count)]
    scene = ["--scene", arguments.scene] if arguments.scene else []
    start = ["--start", str(START)] if arguments.one_show else []
    run = ["run", "--json", "--quiet", "--loop", "--rate", str(rate), *start]
    publishers = [subprocess.Popen([PROGRAM, "--name", name, *scene, *run], stdout=subprocess.PIPE) for name in names]
    reader = [part for name in names for part in ("--name", name)] + ["metrics", "--json", "--listen", "127.0.0.1:0"]
    reader = subprocess.Popen([PROGRAM, *reader], stdout=subprocess.PIPE)
    try:
        url = json.loads(reader.stdout.readline())["url"]
        # The search for contacts of a show of several may take longer.
        while missed(url)[0] < count:
            time.sleep(0.1)
        time.sleep(WARM_UP)
        began = time.monotonic()
        before = [cpu_seconds(one) for one in [*publishers, reader]]
        received, lost = missed(url)
        time.sleep(arguments.seconds)
        passed = time.monotonic() - began
        cpu = [100 * (cpu_seconds(one) - then) / passed for one, then in zip([*publishers, reader], before)]
        memory = [resident_mb(one) for one in publishers]
        now_received, now_lost = missed(url)
        for one in publishers:
            one.send_signal(signal.SIGTERM)
        summaries = [json.loads(one.communicate()[0].splitlines()[-1]) for one in publishers]
    finally:
        for one in [*publishers, reader]:
            one.kill()
            one.wait()
    lateness = {name: [one["wakeup_ns"][name] / 1000 for one in summaries] for name in ("p50", "p99", "max")}
    return {
        "cpu": cpu[:-1], "memory": memory, **lateness, "reader": cpu[-1],
        "step": [one["step_ns"]["p99"] / 1000 for one in summaries],
        "skipped": sum(one["skipped"] for one in summaries), "periods": sum(one["skipped"] + one["frames"] for one in summaries),
        "missed": now_lost - lost, "received": now_received - received,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    numbers = lambda text: [int(one) for one in text.split(",")]
    parser.add_argument("--seconds", type=float, default=15)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--counts", type=numbers, default=[1, 2, 10])
    parser.add_argument("--rates", type=numbers, default=[60, 1000])
    parser.add_argument("--scene")
    parser.add_argument("--one-show", type=int, metavar="N")
    arguments = parser.parse_args()
    if arguments.one_show:
        folder = tempfile.TemporaryDirectory()
        arguments.scene = os.path.join(folder.name, "show.toml")
        with open(arguments.scene, "w", encoding="utf-8") as file:
            file.write(one_show(arguments.one_show))
    print(f"{os.cpu_count()} CPUs; load before: {' '.join(f'{one:.2f}' for one in os.getloadavg())}")
    heads = ("CPU each, %", "memory, MB", "step p99, us", "late p50, us", "late p99, us", "late max, us")
    print(f"{'Hz':>5} {'dragons':>7}" + "".join(f"{one:>22}" for one in heads) + f"{'skipped':>22}{'missed by the reader':>22}{'reader CPU, %':>15}")
    for rate in arguments.rates:
        rounds = {count: [] for count in arguments.counts}
        for _ in range(arguments.rounds):
            for count in arguments.counts:
                rounds[count].append(round_of(count, rate, arguments))
        alone = None
        for count, found in rounds.items():
            medians = {name: statistics.median(value for one in found for value in one[name]) for name in COLUMNS}
            alone = alone or medians
            figures = "".join(f"{f'{medians[name]:.1f} ({medians[name] / alone[name]:.2f} x)':>22}" for name in COLUMNS)
            total = lambda name: sum(one[name] for one in found)
            share = lambda part, whole: f"{total(part):.0f} ({100 * total(part) / max(1, whole):.3f} %)"
            lost = share("missed", total("missed") + total("received"))
            reader = statistics.median(one["reader"] for one in found)
            print(f"{rate:>5} {count:>7}{figures}{share('skipped', total('periods')):>22}{lost:>22}{reader:>15.1f}", flush=True)
    print(f"load after: {' '.join(f'{one:.2f}' for one in os.getloadavg())}")


if __name__ == "__main__":
    main()
