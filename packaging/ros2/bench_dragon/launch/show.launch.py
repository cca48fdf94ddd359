"""A show on ROS 2, and RViz on request.

    ros2 launch bench_dragon show.launch.py scene:=paper name:=gold rate:=60 rviz:=true
"""

import pathlib

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SHARE = pathlib.Path(get_package_share_directory("bench_dragon"))


def scene_file(scene: str) -> str:
    """Returns the file of a scene: a path, or the name of an example scene."""
    return scene if scene.endswith(".toml") else str(SHARE / "scenes" / f"{scene}.toml")


def publisher(context):
    """Returns the node of the publisher. An empty rate is the scene's."""
    scene, name, rate = (LaunchConfiguration(argument).perform(context) for argument in ("scene", "name", "rate"))
    arguments = ["--scene", scene_file(scene), "--name", name] + (["--rate", rate] if rate else [])
    return [Node(package="bench_dragon", executable="publisher", arguments=arguments, output="screen")]


def generate_launch_description():
    """Returns the description that `ros2 launch` runs."""
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        # The layout shows the name bench_dragon.
        arguments=["-d", str(SHARE / "layouts" / "bench_dragon.rviz")],
        condition=IfCondition(LaunchConfiguration("rviz")),
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("scene", default_value="ros2", description="an example scene, or a file (.toml)"),
            DeclareLaunchArgument("name", default_value="bench_dragon", description="the name of topics"),
            DeclareLaunchArgument("rate", default_value="", description="frames per second; by default the scene's"),
            DeclareLaunchArgument("rviz", default_value="false", description="true: open RViz"),
            OpaqueFunction(function=publisher),
            rviz,
        ]
    )
