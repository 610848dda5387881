"""Starts a cell from ROS 2: `ros2 launch probecell_bringup cell.launch.py cell:=/path/to/cell.toml`.

The cell file is the only description of the graph; `probecell up` reads it, starts the processes and watches them, so
that this file has nothing to repeat. `probecell` must be in the path.
"""

import pathlib

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration


def generate_launch_description():
    default = pathlib.Path(__file__).with_name("turn_mill.toml")
    return LaunchDescription(
        [
            DeclareLaunchArgument("cell", default_value=str(default), description="cell file"),
            ExecuteProcess(cmd=["probecell", "up", LaunchConfiguration("cell")], output="screen"),
        ]
    )
