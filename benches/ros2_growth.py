"""Growth of `send ros2`: resident memory, threads and file descriptors while ROS 2 subscribers come and go.

    cargo build --release && .venv/bin/python benches/ros2_growth.py [--minutes 10]

At 60 Hz; a Cyclone DDS subscriber (`pip install cyclonedds==11.0.1`) runs for five seconds; every second one is killed.
"""

import argparse
import os
import pathlib
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]


def look(process):
    """Returns resident memory in MB, threads and file descriptors of a process."""
    status = dict(line.split(":", 1) for line in pathlib.Path(f"/proc/{process}/status").read_text().splitlines())
    return int(status["VmRSS"].split()[0]) / 1024, int(status["Threads"]), len(os.listdir(f"/proc/{process}/fd"))


def sender(publisher):
    """Returns the process of ROS 2 of a publisher."""
    while publisher.poll() is None:
        for children in pathlib.Path(f"/proc/{publisher.pid}/task").glob("*/children"):
            for child in children.read_text().split():
                if b"\0ros2\0" in pathlib.Path(f"/proc/{child}/cmdline").read_bytes():
                    return int(child)
        time.sleep(0.1)
    sys.exit("the publisher has ended")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    arguments = parser.parse_args()
    name = f"growth_{os.getpid()}"
    seconds = arguments.minutes * 60.0
    publisher = subprocess.Popen([ROOT / "target/release/bench-dragon", "run", "--ros2", "--quiet", "--loop",
                                  "--name", name, "--duration", str(seconds + 10.0)], stdout=subprocess.DEVNULL)
    process = sender(publisher)
    start = time.monotonic()
    readers = 0
    print("  minute  resident MB  threads  file descriptors  subscribers so far")
    next_look = start + 5.0
    while time.monotonic() < start + seconds:
        reader = subprocess.Popen([sys.executable, ROOT / "examples/python/cyclone_listener.py", "--name", name,
                                   "--seconds", "5"], stdout=subprocess.DEVNULL)
        readers += 1
        time.sleep(4.0)
        if readers % 2 == 0:
            reader.send_signal(signal.SIGKILL)
        reader.wait()
        if time.monotonic() >= next_look:
            next_look += max(seconds / 12.0, 10.0)
            memory, threads, files = look(process)
            print(f"{(time.monotonic() - start) / 60:8.1f} {memory:12.1f} {threads:8} {files:17} {readers:19}", flush=True)
    publisher.terminate()
    publisher.wait()


if __name__ == "__main__":
    main()
