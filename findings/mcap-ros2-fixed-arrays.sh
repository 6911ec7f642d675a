#!/usr/bin/env bash
# mcap-ros2-support 0.6.0: a covariance of the wrong length is padded or cut, without a word;
# arrays of numpy are refused.
#
# Expected: a fixed array `float64[3]` takes three values; rosbags 0.11.9 and
# @foxglove/rosmsg2-serialization 3.1.0 refuse two or four.
# Seen: two values become three with a 0, of four the last is dropped; a bounded string `string<=2`
# is written in full. `np.zeros(3)` for the same field is an error, "is not an array".
# So: a 3 x 3 covariance put into the 36 numbers of a pose is padded with zeros, a legal "no error
# at all": check lengths before this writer.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap==1.6.0 mcap-ros2-support==0.6.0 rosbags==0.11.9
"$dir/venv/bin/python" - <<'PY'
import io
import sys
import numpy as np
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer
from rosbags.typesys import Stores, get_typestore, get_types_from_msg

TEXT = "float64[3] v\nstring<=2 s\n"

def by_mcap(values):
    file = io.BytesIO()
    writer = Writer(file)
    try:
        writer.write_message("/t", writer.register_msgdef("p/msg/M", TEXT), {"v": values, "s": "long"}, log_time=1, publish_time=1)
    except ValueError as error:
        return "refused"
    writer.finish()
    message = next(iter(read_ros2_messages(io.BytesIO(file.getvalue())))).ros_msg
    return message.v, message.s

def by_rosbags(values):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(TEXT, "p/msg/M"))
    try:
        return bytes(store.serialize_cdr(store.types["p/msg/M"](np.array(values), "ab"), "p/msg/M")).hex()[:8]
    except Exception as error:
        return "refused"

found = {str(values): (by_mcap(values), by_rosbags(values)) for values in ([1.0, 2.0], [1.0, 2.0, 3.0, 4.0])}
found["numpy"] = by_mcap(np.zeros(3))
for values, result in found.items():
    print(values, result)
if found["[1.0, 2.0]"] != (([1.0, 2.0, 0.0], "long"), "refused"):
    sys.exit("changed: two values give %s" % (found["[1.0, 2.0]"],))
if found["[1.0, 2.0, 3.0, 4.0]"] != (([1.0, 2.0, 3.0], "long"), "refused") or found["numpy"] != "refused":
    sys.exit("changed: four values or numpy give %s" % found)
PY
