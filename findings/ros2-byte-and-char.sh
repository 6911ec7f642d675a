#!/usr/bin/env bash
# Two Python readers of ROS 2 recordings, each with the wrong sign for the other's type: rosbags
# 0.11.9 and mcap-ros2-support 0.6.0.
#
# Expected: in ROS 2 `byte` is an octet and `char` an unsigned 8-bit number (interface definition
# language of ROS 2), so a cell of 200 is 200 in both. (In ROS 1 `byte` was signed.)
# Seen: of the same bytes rosbags reads a `byte` as -56 and a `char` as 200, mcap-ros2-support a
# `byte` as 200 and a `char` as -56. rosbags refuses to write a `byte` of 200.
# So: `uint8` and `int8` are read alike by both: use those in own messages; of foreign ones take
# `& 0xff` for byte and char.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rosbags==0.11.9 mcap-ros2-support==0.6.0
"$dir/venv/bin/python" - <<'PY'
import struct
import sys
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

text = "byte byte_value\nchar char_value\nuint8 uint8_value\nint8 int8_value\nbyte[] bytes_value\nchar[2] chars_value\n"
store = get_typestore(Stores.ROS2_JAZZY)
store.register(get_types_from_msg(text, "example_msgs/msg/Cell"))
data = b"\x00\x01\x00\x00" + bytes([200, 200, 200, 200]) + struct.pack("<I", 2) + bytes([200, 1, 200, 1])
messages = {
    "rosbags": store.deserialize_cdr(data, "example_msgs/msg/Cell"),
    "mcap-ros2-support": generate_dynamic("example_msgs/msg/Cell", text)["example_msgs/msg/Cell"](data),
}
names = ("byte", "char", "uint8", "int8", "bytes", "chars")
found = {}
for library, message in messages.items():
    values = [getattr(message, name + "_value") for name in names]
    found[library] = {n: int(v) if isinstance(v, int) else [int(x) for x in v] for n, v in zip(names, values)}
    print(library, found[library])
try:
    cell = messages["rosbags"]
    cell.byte_value = 200
    store.serialize_cdr(cell, "example_msgs/msg/Cell")
    written = True
except Exception as error:
    written = False
    print("rosbags writing a byte of 200:", error)
right = {"uint8": 200, "int8": -56}
if found["rosbags"] != {"byte": -56, "char": 200, **right, "bytes": [-56, 1], "chars": [200, 1]} or written:
    sys.exit("changed: rosbags has %s" % found["rosbags"])
if found["mcap-ros2-support"] != {"byte": 200, "char": -56, **right, "bytes": [200, 1], "chars": [-56, 1]}:
    sys.exit("changed: mcap-ros2-support has %s" % found["mcap-ros2-support"])
PY
