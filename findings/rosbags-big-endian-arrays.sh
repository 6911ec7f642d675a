#!/usr/bin/env bash
# rosbags 0.11.9: an array with the other byte order is written as it lies in memory: 1.0 becomes
# 4.6e-41.
#
# Expected: a numpy array of type '>f4' (what readers of big-endian PLY, PCAP and FITS files hand
# out) holds the numbers 1, 2, 3; a little-endian CDR message holds them too, or the type is
# refused, as float64 for float32 is.
# Seen: the bytes are copied. The message is well-formed, of the right length, and full of tiny
# numbers.
# So: `np.ascontiguousarray(a, dtype="<f4")` before serialising (a wrong size is refused, a wrong
# order is not); in a recording, a cloud whose values are all near 1e-41 was written this way and
# can be mended.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rosbags==0.11.9
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
array = store.types["std_msgs/msg/Float32MultiArray"]
layout = store.types["std_msgs/msg/MultiArrayLayout"]

def through(data):
    try:
        raw = store.serialize_cdr(array(layout([], 0), data), array.__msgtype__)
    except ValueError as error:
        return "refused: %s" % error
    return store.deserialize_cdr(raw, array.__msgtype__).data.tolist()

little, big, wide = through(np.array([1, 2, 3], "<f4")), through(np.array([1, 2, 3], ">f4")), through(np.array([1.0, 2.0, 3.0]))
print("<f4:", little, "| >f4:", big, "| f8:", wide)
if little != [1.0, 2.0, 3.0] or not str(wide).startswith("refused"):
    sys.exit("changed: <f4 gives %s, f8 %s" % (little, wide))
if not all(0 < value < 1e-40 for value in big):
    sys.exit("changed: >f4 gives %s" % big)
PY
