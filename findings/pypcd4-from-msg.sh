#!/usr/bin/env bash
# pypcd4 1.5.1: of a PointCloud2 of ROS `from_msg` reads padding as points at the origin, and big-
# endian metres as 1e-41.
#
# Expected: `PointCloud.from_msg` follows the message: `row_step`, `is_bigendian` and the offset of
# each field, in any order in which the fields are listed.
# Seen: the data is one array of points from the first byte to the last. Two rows of 4 points with
# 16 bytes of padding each are 10 points, two of them at 0 0 0, in a cloud that says width 4, height
# 2. `is_bigendian` is not read. Fields are laid one after the other as listed: with intensity
# (offset 12) listed first, 7 points of 16 bytes become 4 of 28; other numbers of points raise
# ValueError. Of an organised cloud that is read well, `to_msg` makes a single row.
# So: bring the data to one row, little-endian, and fields in the order of their offsets first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pypcd4==1.5.1 rosbags==0.11.9
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from pypcd4 import PointCloud
from rosbags.typesys.stores import latest as ros

def cloud(listed="xyzi", order="<", padding=0, width=4, height=2):
    kind = np.dtype([(name, order + "f4") for name in "xyzi"])
    points = np.zeros((height, width), kind)
    points["x"], points["y"], points["z"], points["i"] = np.arange(1, 1 + width * height).reshape(height, width), 10, 20, 99
    data = b"".join(row.tobytes() + bytes(padding) for row in points)
    fields = [ros.sensor_msgs__msg__PointField(name=name, offset=kind.fields[name][1], datatype=7, count=1) for name in listed]
    header = ros.std_msgs__msg__Header(stamp=ros.builtin_interfaces__msg__Time(0, 0), frame_id="")
    return ros.sensor_msgs__msg__PointCloud2(
        header=header, height=height, width=width, fields=fields, is_bigendian=order == ">", point_step=16,
        row_step=16 * width + padding, data=np.frombuffer(data, np.uint8), is_dense=True)

def xs(name, message):
    found = PointCloud.from_msg(message)
    values = [float(value) for value in found.pc_data["x"]]
    print(f"{name}: {message.width * message.height} points, read as {len(values)} with x {[float('%.2g' % value) for value in values]}")
    return values

plain = xs("plain", cloud())
padded = xs("padding of 16 bytes", cloud(padding=16))
big = xs("big-endian", cloud(order=">"))
listed = xs("intensity listed first", cloud("ixyz", width=7, height=1))
back = PointCloud.from_msg(cloud()).to_msg()
print(f"2 rows of 4, there and back: {back.height} of {back.width}")
if plain != list(range(1, 9)) or padded != [1, 2, 3, 4, 0, 5, 6, 7, 8, 0] or max(big) > 1e-30:
    sys.exit("changed: %s %s %s" % (plain, padded, big))
if len(listed) != 4 or (back.height, back.width) != (1, 8):
    sys.exit("changed: %s, %d rows" % (listed, back.height))
PY
