"""Prints the head's place once a second from the ROS 2 topic, without ROS: `pip install cyclonedds==11.0.1`.

    python3 examples/python/cyclone_listener.py [--name bench_dragon] [--seconds 10]

Start a publisher first: `cargo run --release -- run --ros2`. With ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST for both they
meet on this machine's loopback interface.
"""

import argparse
import os
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int32, sequence, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


# The settings of Cyclone DDS for the range LOCALHOST: a publisher of that range is on the loopback interface alone.
LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General></Domain>'
    "</CycloneDDS>"
)


@final
@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@final
@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@final
@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@final
@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@final
@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@final
@dataclass
class PoseArray(IdlStruct, typename="geometry_msgs::msg::dds_::PoseArray_"):
    header: Header
    poses: sequence[Pose]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments = parser.parse_args()
    is_local = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST"
    if is_local or os.environ.get("ROS_LOCALHOST_ONLY") == "1":
        os.environ.setdefault("CYCLONEDDS_URI", LOOPBACK)
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID") or 0))
    topic = Topic(participant, f"rt/{arguments.name}/poses", PoseArray)
    kept = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10))
    reader = DataReader(participant, topic, qos=kept)
    end = time.monotonic() + arguments.seconds
    report = time.monotonic() + 1.0
    frames, newest = 0, None
    while time.monotonic() < end:
        for message in reader.take(N=10):
            # The notice that a publisher has gone comes as an empty sample.
            if isinstance(message, PoseArray):
                frames, newest = frames + 1, message
        if time.monotonic() >= report:
            report += 1.0
            if newest is None:
                print("waiting for a publisher", flush=True)
            else:
                head = newest.poses[0].position
                print(
                    f"{frames} frames in the last second, {len(newest.poses)} handles, "
                    f"head ({head.x:.3f}, {head.y:.3f}) m",
                    flush=True,
                )
            frames = 0
        time.sleep(0.005)


if __name__ == "__main__":
    main()
