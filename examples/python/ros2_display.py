"""Shows the place of the head at the time of display, 20 times a second, whatever the rate of the topic.

    source /opt/ros/jazzy/setup.bash && source install/setup.bash        # with bench_dragon_msgs built, see docs/ros2.md
    python3 examples/python/ros2_display.py [--name bench_dragon] [--delay 0.1]

Between two messages the handles are interpolated by their velocities (`HermiteReader`): ten messages a second give an
accuracy of about 20 nanometres. The newest message alone is up to a tenth of a second old. `HermiteReader` is in the
module `bench_dragon` beside this file, which needs numpy.
"""

import argparse
import time

import numpy as np
from bench_dragon import HermiteReader

HANDLE_POSE = np.dtype([(field, "<f8") for field in ("x", "y", "heading", "vx", "vy")])


def handles_of(message):
    """Returns the poses of a bench_dragon_msgs/HandlePoses as a structured array."""
    return np.array([tuple(getattr(pose, field) for field in HANDLE_POSE.names) for pose in message.poses], HANDLE_POSE)


def heads_of(handles, stage):
    """Returns the heads in words: one, or one of each dragon of the stage by its name."""
    dragons = stage.dragons if stage is not None else []
    heads = [(f" of {dragon.name}", dragon.first_handle) for dragon in dragons] if len(dragons) > 1 else [("", 0)]
    return ", ".join(f"head{of} ({handles['x'][at]:.4f}, {handles['y'][at]:.4f}) m" for of, at in heads)


def main():
    import rclpy
    from bench_dragon_msgs.msg import HandlePoses, Stage
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("--delay", type=float, default=0.1, help="seconds behind the present: a period and a little")
    arguments = parser.parse_args()
    rclpy.init()
    node, reader, stage = Node("bench_dragon_display"), HermiteReader(), None

    def receive_stage(message):
        nonlocal stage
        stage = message
        reader.set_stage(stage)

    kept = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(Stage, f"/{arguments.name}/stage", receive_stage, kept)
    # A message carries the fields of the frame's header by their names.
    node.create_subscription(
        HandlePoses, f"/{arguments.name}/handles", lambda message: reader.push(message, handles_of(message)), 10
    )

    def show():
        # CLOCK_MONOTONIC of the publisher's machine, on which this program must run too.
        shown = reader.at(time.monotonic_ns() - int(1e9 * arguments.delay))
        if shown is not None:
            moment, handles = shown
            node.get_logger().info(f"t = {moment:.4f} s  {heads_of(handles, stage)}")

    node.create_timer(0.05, show)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
