"""One run for `ros2 launch`: a world server, a process for each agent and, if asked for, RViz 2.

    ros2 launch launch_scripts/maes.launch.py agents:=5 controller:=dsvp size:=100 rviz:=true
    ros2 launch launch_scripts/maes.launch.py --show-args

The launch ends with the run. `maes run` does the same without ROS, and has more flags. In a checkout
build the binaries first (`cargo build --release`); as a part of the installed ROS 2 package `maes`
(`ros2 launch maes maes.launch.py`) or of a release this file takes those that came with it.
"""

import os
import secrets
import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, RegisterEventHandler, Shutdown
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.substitutions import LaunchConfiguration

HERE = os.path.dirname(os.path.abspath(__file__))


def binaries():
    """The folder of the binaries: of the environment, of the ROS 2 package, of a release or of the
    checkout.
    """
    above = os.path.normpath(os.path.join(HERE, "..", "..", ".."))
    built = os.path.join(os.path.dirname(HERE), "target", "release")
    folders = [os.path.join(above, "lib", "maes"), os.path.join(above, "bin")]
    installed = [folder for folder in folders if os.path.isfile(os.path.join(folder, "sim_server"))]
    return os.environ.get("MAES_BIN_DIR") or [*installed, built][0]


# Name, value if none is given, what it is. Those without a value are left to the scenario.
ARGUMENTS = [
    ("scenario", os.path.join(HERE, "scenarios", "default.toml"), "the scenario (.toml)"),
    ("agents", "5", "number of agents"),
    ("controller", "", "what they run: rbw, lvd, dsvp, ..."),
    ("map", "", "spheres, noise or a map file"),
    ("size", "", "cells along each axis"),
    ("seed", "", "of the map and of the agents"),
    ("duration", "", "sim time after which the run ends, seconds"),
    ("rtf", "1", "sim seconds for each second of wall time, or max"),
    ("record", "", "where the recording goes (.mcap)"),
    ("flags", "", "any other flags of `sim_server run`, in one string"),
    ("external", "", "ids of agents that are started elsewhere, for example 0,3"),
    ("rviz", "false", "whether to start RViz 2 with maes.rviz beside this file"),
    ("bin_dir", binaries(), "where the binaries are"),
]
SERVER_FLAGS = ["agents", "controller", "map", "size", "seed", "duration", "rtf", "record"]


def processes(context):
    values = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    flags = [text for name in SERVER_FLAGS if values[name] for text in (f"--{name}", values[name])]
    external = {int(number) for number in values["external"].replace(",", " ").split()}
    if external:
        flags += ["--external", ",".join(str(number) for number in sorted(external))]
    # Only these processes know it, unless the user has chosen one.
    secret = {"MAES_JOIN_SECRET": os.environ.get("MAES_JOIN_SECRET") or secrets.token_hex(32)}
    server = ExecuteProcess(
        additional_env=secret,
        cmd=[
            os.path.join(values["bin_dir"], "sim_server"),
            "run",
            values["scenario"],
            *flags,
            *shlex.split(values["flags"]),
        ],
        name="sim_server",
        output="screen",
    )
    agents = [
        ExecuteProcess(
            additional_env=secret,
            cmd=[os.path.join(values["bin_dir"], "agent_node"), "--id", str(number)],
            name=f"agent_{number}",
            output="log",
        )
        for number in range(int(values["agents"]))
        if number not in external
    ]
    end = RegisterEventHandler(OnProcessExit(target_action=server, on_exit=[Shutdown(reason="the run is over")]))
    return [end, server, *agents]


def generate_launch_description():
    rviz = ExecuteProcess(
        cmd=["rviz2", "-d", os.path.join(HERE, "maes.rviz"), "--ros-args", "-p", "use_sim_time:=true"],
        condition=IfCondition(LaunchConfiguration("rviz")),
        output="log",
    )
    arguments = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*arguments, OpaqueFunction(function=processes), rviz])
