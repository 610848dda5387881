"""Starts a cell from ROS 2: `ros2 launch probecell_bringup cell.launch.py cell:=/path/to/cell.toml name:=cell_2`.

The cell file is the only description of the graph; `probecell up` reads it, starts the processes and watches them, so that this
file has nothing to repeat: its arguments are those of that command. `probecell` must be in the path. `--show-args` lists them.
"""

import pathlib
import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

# Name: default, description.
ARGUMENTS = {
    "cell": (str(pathlib.Path(__file__).with_name("turn_mill.toml")), "cell file"),
    "name": ("", "name of the cell, which is the namespace of its nodes and topics; empty: that of the cell file"),
    "once": ("false", "make one part, then end"),
    "record": ("true", "record everything"),
    "dashboard": ("true", "serve the dashboard"),
    "settings": ("", "settings in place of those of the cell file, NODE:KEY:=VALUE, separated by blanks"),
    "remap": ("", "other names outside of the cell, such as /tf:=/hall/tf, separated by blanks"),
}
# s that `up` has after Ctrl-C, to stop the machine, to report the part and to close the recording.
GRACE = "30"


def command(cell, name, once, record, dashboard, settings, remap):
    """The words of the command."""
    flags = {"true": True, "1": True, "false": False, "0": False}
    words = ["probecell", "up", cell]
    words += ["--once"] * flags[once.lower()]
    words += ["--no-record"] * (not flags[record.lower()])
    words += ["--no-dashboard"] * (not flags[dashboard.lower()])
    rules = [word for one in shlex.split(settings) for word in ("-p", one)]
    rules += [word for one in shlex.split(remap) for word in ("-r", one)]
    rules += ["-r", f"__ns:=/{name.strip('/')}"] if name else []
    return words + (["--ros-args", *rules] if rules else [])


def start(context):
    values = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    return [ExecuteProcess(cmd=command(**values), output="screen", sigterm_timeout=GRACE, sigkill_timeout=GRACE)]


def generate_launch_description():
    declared = [DeclareLaunchArgument(name, default_value=default, description=text) for name, (default, text) in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
