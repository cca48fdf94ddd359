"""Prints every collision alert, with rclpy and this project's own messages. Build those first, from a checkout:

    source /opt/ros/jazzy/setup.bash
    colcon build --base-paths msgs
    source install/setup.bash
    python3 examples/python/ros2_alerts.py [--name bench_dragon]

Start a publisher first: `cargo run --release -- run --ros2 --start 400`.
"""

import argparse

import rclpy
from bench_dragon_msgs.msg import CollisionAlert
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LEVELS = {
    CollisionAlert.LEVEL_CLEAR: "clear",
    CollisionAlert.LEVEL_APPROACHING: "approaching",
    CollisionAlert.LEVEL_CONTACT: "contact",
    CollisionAlert.LEVEL_STALL: "stall",
    CollisionAlert.LEVEL_LOCK: "lock",
}


EVENTS = {
    CollisionAlert.EVENT_CONTACT: "contact",
    CollisionAlert.EVENT_STALL: "stall",
    CollisionAlert.EVENT_LOCK: "lock",
}


def benches(*numbers):
    """Returns benches as people name them, counted from 1."""
    return " and ".join(f"bench {number + 1}" for number in numbers if number != CollisionAlert.NO_BENCH)


class Alerts(Node):
    """Prints the alerts. A late subscriber gets the alert in effect: the publisher keeps it."""

    def __init__(self, name):
        super().__init__("bench_dragon_alerts")
        kept = QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        self.create_subscription(CollisionAlert, f"/{name}/alerts", self._receive, kept)

    def _receive(self, alert):
        text = f"t = {alert.sim_time:.3f} s  {LEVELS.get(alert.level, alert.level)}"
        if alert.event in EVENTS:
            text += f"  {EVENTS[alert.event]}: {benches(alert.event_bench_a, alert.event_bench_b)}"
        if alert.time_to_event > 0.0:
            text += f" in {alert.time_to_event:.1f} s"
        if alert.bench_a != CollisionAlert.NO_BENCH:
            text += f"; nearest now are {benches(alert.bench_a, alert.bench_b)}, {alert.clearance * 1000.0:.1f} mm apart"
        self.get_logger().info(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    arguments = parser.parse_args()
    rclpy.init()
    try:
        rclpy.spin(Alerts(arguments.name))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
