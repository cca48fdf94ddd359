"""Growth of `send ros2`: resident memory, threads and file descriptors while ROS 2 subscribers come and go.

    cargo build --release && .venv/bin/python benches/ros2_growth.py [--subscribers 1000] [--fast-dds PEER]

At 60 Hz. Four subscribers at a time, for three seconds each; every second one is killed. The subscribers are processes
of Cyclone DDS (`pip install cyclonedds==11.0.1`), and with --fast-dds in turn of Fast DDS. PEER is the program of
`g++ -std=c++17 -O1 -o PEER tests/fastdds/peer.cpp -lfastrtps -lfastcdr`.
"""

import argparse
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
BESIDE = 4
POSES = "geometry_msgs::msg::dds_::PoseArray_"


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


def subscriber(number, name, domain, peer):
    """Starts the subscriber of a number."""
    cyclone = [sys.executable, ROOT / "examples/python/cyclone_listener.py", "--name", name, "--seconds", "3"]
    fast = [peer, "subscribe", f"{name}/poses", POSES, "--depth", "10", "--seconds", "3", "--domain", str(domain)]
    return subprocess.Popen(fast if peer and number // 2 % 2 else cyclone, stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL, env={**os.environ, "ROS_DOMAIN_ID": str(domain)})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--subscribers", type=int, default=1000)
    parser.add_argument("--fast-dds", metavar="PEER")
    arguments = parser.parse_args()
    name = f"growth_{os.getpid()}"
    domain = 1 + os.getpid() % 100
    publisher = subprocess.Popen([ROOT / "target/release/bench-dragon", "--name", name, "--quiet", "run", "--ros2",
                                  "--loop"], stdout=subprocess.DEVNULL,
                                 env={**os.environ, "ROS_DOMAIN_ID": str(domain)})
    process = sender(publisher)
    numbers = iter(range(arguments.subscribers))
    lock = threading.Lock()
    start = time.monotonic()
    print("subscribers  minute  resident MB  threads  file descriptors")

    def come_and_go():
        while True:
            with lock:
                number = next(numbers, None)
                if number is None:
                    return
                if number % 50 == 0:
                    memory, threads, files = look(process)
                    minute = (time.monotonic() - start) / 60
                    print(f"{number:11} {minute:7.1f} {memory:12.1f} {threads:8} {files:17}", flush=True)
            reader = subscriber(number, name, domain, arguments.fast_dds)
            if number % 2:
                time.sleep(random.uniform(1.5, 3.0))
                reader.send_signal(signal.SIGKILL)
            reader.wait()

    workers = [threading.Thread(target=come_and_go) for _ in range(BESIDE)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    # The leases of the killed ones end within 20 s.
    for seconds in (0, 30):
        time.sleep(seconds)
        memory, threads, files = look(process)
        print(f"{arguments.subscribers:11} {(time.monotonic() - start) / 60:7.1f} {memory:12.1f} {threads:8} "
              f"{files:17}", flush=True)
    publisher.terminate()
    publisher.wait()


if __name__ == "__main__":
    main()
