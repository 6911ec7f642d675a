#!/usr/bin/env python3
"""Writes fixtures/cdr.txt: messages as a real ROS 2 serialises them, for the tests in this folder.

    eval "$(launch_scripts/ros_env.sh)" && python3 tests/interface/make_fixtures.py

One line for each type and way of filling it: type, way, bytes in hexadecimal. "default" is the message as it is created;
"sample" has another value in every field, by the rule below, which sample.rs repeats. To be run again whenever a
.msg file changes; the same messages give the same file.
"""

import ctypes
import importlib
import os
import pathlib
import re
import sys

import numpy
from rclpy.serialization import serialize_message

HERE = pathlib.Path(__file__).resolve().parent
FIXTURES = HERE / "fixtures" / "cdr.txt"

# With this setting fresh memory is filled with what M_PERTURB says, always.
NO_CACHE = "glibc.malloc.tcache_count=0"
M_PERTURB = -6

STANDARD = [
    "builtin_interfaces/Duration",
    "builtin_interfaces/Time",
    "diagnostic_msgs/DiagnosticArray",
    "diagnostic_msgs/DiagnosticStatus",
    "diagnostic_msgs/KeyValue",
    "geometry_msgs/Point",
    "geometry_msgs/Pose",
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseWithCovariance",
    "geometry_msgs/Quaternion",
    "geometry_msgs/Transform",
    "geometry_msgs/TransformStamped",
    "geometry_msgs/Twist",
    "geometry_msgs/TwistStamped",
    "geometry_msgs/TwistWithCovariance",
    "geometry_msgs/Vector3",
    "nav_msgs/MapMetaData",
    "nav_msgs/OccupancyGrid",
    "nav_msgs/Odometry",
    "nav_msgs/Path",
    "octomap_msgs/Octomap",
    "rcl_interfaces/Log",
    "rosgraph_msgs/Clock",
    "sensor_msgs/BatteryState",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/CompressedImage",
    "sensor_msgs/Image",
    "sensor_msgs/LaserScan",
    "sensor_msgs/PointCloud2",
    "sensor_msgs/PointField",
    "sensor_msgs/RegionOfInterest",
    "std_msgs/ColorRGBA",
    "std_msgs/Header",
    "std_msgs/String",
    "tf2_msgs/TFMessage",
    "visualization_msgs/Marker",
    "visualization_msgs/MarkerArray",
    "visualization_msgs/MeshFile",
    "visualization_msgs/UVCoordinate",
]


class Sample:
    """The n-th primitive value of a message, counted from 1, is a function of n and its type.

    Integers are the low bits of n times an odd constant, floats are n / 8, booleans tell whether n is odd, strings are
    "é" n % 4 times and then n. A sequence of unspecified length has two elements.
    """

    def __init__(self):
        self.n = 0

    def primitive(self, kind):
        self.n += 1
        n = self.n
        if kind == "boolean":
            return n % 2 == 1
        if kind == "octet":
            return bytes([n * 0x9E3779B97F4A7C15 % 256])
        if kind in ("double", "float"):
            return n / 8
        if kind == "string":
            return "é" * (n % 4) + str(n)
        signed, bits = re.fullmatch(r"(u?)int(\d+)", kind).groups()
        value = n * 0x9E3779B97F4A7C15 % 2 ** int(bits)
        return value if signed or value < 2 ** (int(bits) - 1) else value - 2 ** int(bits)

    def value(self, kind, present):
        """A value of IDL type `kind`; `present` is what the field holds now."""
        sequence = re.fullmatch(r"sequence<(.*)>", kind)
        array = re.fullmatch(r"(.*)\[(\d+)\]", kind)
        if sequence:
            return [self.value(sequence[1], None) for _ in range(2)]
        if array:
            values = [self.value(array[1], None) for _ in range(int(array[2]))]
            return numpy.array(values, dtype=present.dtype) if isinstance(present, numpy.ndarray) else values
        if "/" in kind:
            return self.fill(message_class(kind)())
        return self.primitive(kind)

    def fill(self, message):
        for name, kind in message.get_fields_and_field_types().items():
            setattr(message, name, self.value(kind, getattr(message, name)))
        return message


def message_class(name):
    package, name = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def serialised(message):
    """The bytes that mean something, with zeros as padding.

    rclpy hands out a buffer of estimated length, and Fast DDS leaves the padding between fields as it finds it in memory. Both
    show when the memory is filled with something else beforehand.
    """
    fills = []
    for perturb in (0xFF, 0xAA):  # fills with 0x00, then with 0x55
        ctypes.CDLL(None).mallopt(M_PERTURB, perturb)
        fills.append(bytes(serialize_message(message)))
    length = max(i + 1 for i, (a, b) in enumerate(zip(*fills)) if a == b)
    return fills[0][:length]


def main():
    if os.environ.get("GLIBC_TUNABLES") != NO_CACHE:
        os.execve(sys.executable, [sys.executable, __file__], {**os.environ, "GLIBC_TUNABLES": NO_CACHE})
    ours = [f"maes_msgs/{path.stem}" for path in (HERE.parents[1] / "msgs" / "msg").glob("*.msg")]
    with FIXTURES.open("w") as out:
        for name in sorted(STANDARD + ours):
            default = message_class(name)()
            sample = Sample().fill(message_class(name)())
            for way, message in (("default", default), ("sample", sample)):
                out.write(f"{name} {way} {serialised(message).hex()}\n")


if __name__ == "__main__":
    main()
