"""A user's own launch file: a namespace, a name, and parameters, which launch_ros writes into a file."""

from launch import LaunchDescription
from launch_ros.actions import Node, PushRosNamespace


def generate_launch_description():
    """Returns the description that `ros2 launch` runs."""
    publisher = Node(
        package="bench_dragon",
        executable="publisher",
        namespace="hall",
        name="gold",
        parameters=[{"rate": 20.0, "use_sim_time": False}],
        output="screen",
    )
    return LaunchDescription([PushRosNamespace("outer"), publisher])
