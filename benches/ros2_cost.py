"""Cost of ROS 2 for the loop: runs the publisher at 1 kHz with and without `--ros2`, in turn, and prints the ratios.

    cargo build --release && python3 benches/ros2_cost.py [--rounds 5] [--seconds 10]
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[1]
FIGURES = [("wake-up lateness", "wakeup_ns", "p50"), ("wake-up lateness", "wakeup_ns", "p99"),
           ("step cost", "step_ns", "p50"), ("step cost", "step_ns", "p99")]


def play(options, seconds):
    """Returns the summary of one run."""
    command = [ROOT / "target/release/bench-dragon", "run", "--json", "--quiet", "--rate", "1000", "--start", "300",
               "--duration", str(seconds), "--name", f"cost_{os.getpid()}", *options]
    lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return json.loads(lines[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=int, default=10)
    arguments = parser.parse_args()
    plain, ros2 = [], []
    for _ in range(arguments.rounds):
        plain.append(play([], arguments.seconds))
        ros2.append(play(["--ros2"], arguments.seconds))
    print("median of the rounds              plain     --ros2   ratio")
    for label, group, percentile in FIGURES:
        before, after = (statistics.median(run[group][percentile] for run in runs) for runs in (plain, ros2))
        print(f"{label:18} {percentile}  {before / 1e3:9.1f} us {after / 1e3:7.1f} us   {after / before:5.2f}")
    for label, key in (("frames", "frames"), ("skipped periods", "skipped")):
        print(f"{label:24} {sum(run[key] for run in plain):9} {sum(run[key] for run in ros2):10}")


if __name__ == "__main__":
    main()
