"""A ROS 2 user without ROS who reads the alerts from time to time: Cyclone DDS subscribers, one after the other.

    ros2_joins.py --name NAME --joins N [--pause SECONDS] [--beside] [--volatile] [--seed S]

Each joins at a random time and stays until its first alert, and a little longer. Prints for each a JSON line: the time
of its creation, in nanoseconds of CLOCK_REALTIME, and its alerts. With --beside another subscriber stays all the time.
With --volatile they do not request earlier messages.
"""

import argparse
import json
import random
import sys
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from ros2_peer import TOPICS, quality


def join(name, domain, durability="transient_local"):
    participant = DomainParticipant(domain)
    topic = Topic(participant, f"rt/{name}/alerts", TOPICS["alerts"])
    return participant, DataReader(participant, topic, qos=quality("reliable", durability))


def take(reader):
    return [sample for sample in reader.take(N=100) if isinstance(sample, TOPICS["alerts"])]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("--joins", type=int, required=True)
    parser.add_argument("--pause", type=float, default=0.6, help="seconds between two, at most")
    parser.add_argument("--beside", action="store_true")
    parser.add_argument("--volatile", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--domain", type=int, default=0)
    arguments = parser.parse_args()
    draw = random.Random(arguments.seed)
    beside = join(arguments.name, arguments.domain) if arguments.beside else None
    for _ in range(arguments.joins):
        end = time.monotonic() + draw.uniform(0.0, arguments.pause)
        while time.monotonic() < end:
            if beside:
                take(beside[1])
            time.sleep(0.01)
        made = time.time_ns()
        participant, reader = join(
            arguments.name, arguments.domain, "volatile" if arguments.volatile else "transient_local"
        )
        alerts, deadline, linger = [], time.monotonic() + 60.0, None
        while time.monotonic() < (linger or deadline):
            alerts += take(reader)
            if beside:
                take(beside[1])
            if alerts and linger is None:
                linger = time.monotonic() + 0.15
            time.sleep(0.002)
        alerts = [{"tick": alert.tick, "stamp_ns": alert.stamp_ns} for alert in alerts]
        print(json.dumps({"made_ns": made, "alerts": alerts}), flush=True)
        del reader, participant


if __name__ == "__main__":
    sys.exit(main())
