"""Prints every collision alert, with rclpy and this project's own messages. Build those first, from a checkout:

    source /opt/ros/jazzy/setup.bash
    colcon build --base-paths msgs
    source install/setup.bash
    python3 examples/python/ros2_alerts.py [--name bench_dragon]

Start a publisher first: `cargo run --release -- run --ros2 --start 400`. The words come from the module `bench_dragon`
beside this file, which needs numpy.
"""

import argparse
import time

from bench_dragon import EVENTS, LEVELS, NO_BENCH, name_in

# Seconds for which an alert waits for the stage of its show, which has the names.
STAGE_TIMEOUT = 2.0


def sentence(alert, stage):
    """Returns an alert in words. `stage` is None, or the stage of the alert's show."""

    def names(*numbers):
        return " and ".join(name_in(stage, number) for number in numbers if number != NO_BENCH)

    level = LEVELS[alert.level] if alert.level < len(LEVELS) else None
    text = f"t = {alert.sim_time:.3f} s  {level or alert.level}"
    if alert.event:
        event = EVENTS.get(alert.event) or alert.event
        text += f"  {event}: {names(alert.event_bench_a, alert.event_bench_b)}"
    if alert.time_to_event > 0.0:
        text += f" in {alert.time_to_event:.1f} s"
    if alert.bench_a != NO_BENCH:
        millimetres = alert.clearance * 1000.0
        apart = f"{millimetres:.1f} mm apart" if millimetres >= 0.0 else f"overlapping by {-millimetres:.1f} mm"
        text += f"; nearest now are {names(alert.bench_a, alert.bench_b)}, {apart}"
    return text


def main():
    import rclpy
    from bench_dragon_msgs.msg import CollisionAlert, Stage
    from rclpy.executors import ExternalShutdownException
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    arguments = parser.parse_args()
    rclpy.init()
    node = Node("bench_dragon_alerts")
    stages, waiting = {}, []

    def show():
        while waiting:
            until, alert = waiting[0]
            stage = stages.get(alert.run_id)
            if stage is None and time.monotonic() < until:
                return
            waiting.pop(0)
            node.get_logger().info(sentence(alert, stage))

    def receive_stage(stage):
        stages.clear()
        stages[stage.run_id] = stage
        show()

    def receive(alert):
        waiting.append((time.monotonic() + STAGE_TIMEOUT, alert))
        show()

    # A late subscriber gets the alert in effect, and the stage: the publisher keeps both.
    kept = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(Stage, f"/{arguments.name}/stage", receive_stage, kept)
    node.create_subscription(CollisionAlert, f"/{arguments.name}/alerts", receive, kept)
    node.create_timer(0.5, show)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
