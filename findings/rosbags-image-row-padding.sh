#!/usr/bin/env bash
# rosbags-image 0.10.4: an image whose rows are padded is read as if they were not.
#
# Expected: `step` of sensor_msgs/Image is the length of a row in bytes; cameras pad rows to
# multiples of 4 or 64, and cv_bridge leaves the padding out.
# Seen: `step` is not looked at: the second row of the picture is the padding of the first, and the
# last rows are missing, with no error; an image of 16 bits may come apart in the middle of a
# number. `is_bigendian` is honoured.
# So: reshape the data by `step` and cut the rows before converting.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rosbags-image==0.10.4 rosbags==0.11.9 opencv-python-headless==5.0.0.93
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from rosbags.image import message_to_cvimage
from rosbags.typesys import Stores, get_typestore

types = get_typestore(Stores.ROS2_HUMBLE).types
header = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="")
depths = np.array([[1000, 2000], [3000, 4000]], np.uint16)

def read(padding, big_endian=0):
    stored = depths.byteswap() if big_endian else depths
    rows = np.concatenate([stored.view(np.uint8), np.full((2, padding), 255, np.uint8)], axis=1)
    return message_to_cvimage(types["sensor_msgs/msg/Image"](
        header=header, height=2, width=2, encoding="16UC1", is_bigendian=big_endian, step=rows.shape[1],
        data=rows.ravel())).tolist()

found = {"no padding": read(0), "no padding, big-endian": read(0, 1), "4 bytes": read(4), "3 bytes": read(3)}
for name, rows in found.items():
    print(f"{name}: {rows}")
if found["no padding"] != depths.tolist() or found["no padding, big-endian"] != depths.tolist():
    sys.exit("changed: without padding it is %s" % found["no padding"])
if found["4 bytes"] != [[1000, 2000], [65535, 65535]] or found["3 bytes"][1] == [3000, 4000]:
    sys.exit("changed: with padding it is %s" % found)
PY
