"""Runs an example of ROS 2 as typed, where there is no ROS 2 and no iceoryx2.

    ros2_examples.py FILE NAME

Stands in for rclpy and bench_dragon_msgs. Each line of standard input is a message: JSON with `topic` and `message`.
`rclpy.spin` gives it to the node, and calls the node's timers. The node's log is printed.
"""

import json
import pathlib
import runpy
import sys
import types

FILE, NAME = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]


class Node:
    """A node that keeps its subscriptions and timers."""

    def __init__(self, name):
        self.name, self.topics, self.timers = name, {}, []

    def create_subscription(self, kind, topic, callback, qos):
        assert isinstance(kind, type) and qos, topic
        self.topics[topic] = callback

    def create_timer(self, period, callback):
        assert period > 0.0
        self.timers.append(callback)

    def get_logger(self):
        return types.SimpleNamespace(info=lambda text: print(text, flush=True))


def spin(node):
    for line in sys.stdin:
        line = json.loads(line, object_hook=lambda fields: types.SimpleNamespace(**fields))
        node.topics[f"/{NAME}/{line.topic}"](line.message)
        for timer in node.timers:
            timer()


def module(name, **members):
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(members)


policy = type("Policy", (), {"RELIABLE": 1, "TRANSIENT_LOCAL": 1})
module("rclpy", init=lambda: None, spin=spin, try_shutdown=lambda: None)
module("rclpy.node", Node=Node)
module("rclpy.executors", ExternalShutdownException=type("ExternalShutdownException", (Exception,), {}))
module("rclpy.qos", DurabilityPolicy=policy, ReliabilityPolicy=policy, QoSProfile=lambda **fields: fields)
module("bench_dragon_msgs")
kinds = [file.stem for file in (FILE.parents[2] / "msgs" / "msg").glob("*.msg")]
module("bench_dragon_msgs.msg", **{kind: type(kind, (), {}) for kind in kinds})
# An import of it fails.
sys.modules["iceoryx2"] = None

sys.path.insert(0, str(FILE.parent))
sys.argv = [str(FILE), "--name", NAME]
runpy.run_path(str(FILE), run_name="__main__")
