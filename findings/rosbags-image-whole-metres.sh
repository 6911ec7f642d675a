#!/usr/bin/env bash
# rosbags-image 0.10.4: a depth image converted from 32FC1 to 16UC1 is in whole metres, with 0 for
# what was not measured.
#
# Expected: REP 118 gives the two encodings two units, metres and millimetres; a conversion of the
# one into the other multiplies by 1000, or refuses, as it refuses bgr8.
# Seen: numbers are cast: 1.9 m is 1, which a consumer of 16UC1 takes for a millimetre; NaN ("no
# reading") is 0; and back, 3000 mm are 3000.0 metres. To mono8 a depth of 16 bits is divided by
# 256, one of floats is not scaled.
# So: convert depth images by hand, with the unit in the name of the variable.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rosbags-image==0.10.4 rosbags==0.11.9 opencv-python-headless==5.0.0.93
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
from rosbags.image import ImageError, message_to_cvimage
from rosbags.typesys import Stores, get_typestore

types = get_typestore(Stores.ROS2_HUMBLE).types
header = types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="")

def convert(depths, encoding, target):
    message = types["sensor_msgs/msg/Image"](header=header, height=1, width=len(depths), encoding=encoding, is_bigendian=0,
                                             step=depths.nbytes, data=depths.view(np.uint8))
    try:
        return message_to_cvimage(message, target).ravel().tolist()
    except ImageError as error:
        return type(error).__name__

metres = np.array([1.0, 1.9, np.nan], np.float32)
millimetres = np.array([1000, 3000, 0], np.uint16)
found = {
    "32FC1 to 16UC1": convert(metres, "32FC1", "16UC1"), "16UC1 to 32FC1": convert(millimetres, "16UC1", "32FC1"),
    "32FC1 to mono8": convert(metres, "32FC1", "mono8"), "16UC1 to mono8": convert(millimetres, "16UC1", "mono8"),
    "32FC1 to bgr8": convert(metres, "32FC1", "bgr8"),
}
for name, values in found.items():
    print(f"{name}: {values}")
if found["32FC1 to 16UC1"][:2] != [1, 1] or found["16UC1 to 32FC1"] != [1000.0, 3000.0, 0.0]:
    sys.exit("changed: depths are %s" % found)
if found["16UC1 to mono8"] != [3, 11, 0] or found["32FC1 to mono8"][:2] != [1, 1] or "Error" not in found["32FC1 to bgr8"]:
    sys.exit("changed: pictures are %s" % found)
PY
