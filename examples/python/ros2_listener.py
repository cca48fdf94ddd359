"""Prints the head's place once a second, with rclpy and standard messages: there is nothing to build.

    source /opt/ros/jazzy/setup.bash
    python3 examples/python/ros2_listener.py [--name bench_dragon]

Start a publisher first: `cargo run --release -- run --ros2`.
"""

import argparse

import rclpy
from geometry_msgs.msg import PoseArray
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class Listener(Node):
    """Counts the frames and keeps the newest."""

    def __init__(self, name):
        super().__init__("bench_dragon_listener")
        self._frames = 0
        self._newest = None
        self.create_subscription(PoseArray, f"/{name}/poses", self._receive, 10)
        self.create_timer(1.0, self._report)

    def _receive(self, message):
        self._frames += 1
        self._newest = message

    def _report(self):
        if self._newest is None:
            self.get_logger().info("waiting for a publisher")
            return
        head = self._newest.poses[0].position
        self.get_logger().info(
            f"{self._frames} frames in the last second, {len(self._newest.poses)} handles, "
            f"head ({head.x:.3f}, {head.y:.3f}) m"
        )
        self._frames = 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    arguments = parser.parse_args()
    rclpy.init()
    try:
        rclpy.spin(Listener(arguments.name))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
