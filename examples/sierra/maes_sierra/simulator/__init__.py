"""MAES as an engine of SIERRA. A run is a process, and needs neither ROS 2 nor a display."""


def sierra_plugin_type() -> str:
    return "pipeline"
