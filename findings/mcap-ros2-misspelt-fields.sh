#!/usr/bin/env bash
# mcap-ros2-support 0.6.0: a misspelt field is recorded as 0, and 1.9 in an integer as 1.
#
# Expected: a writer that is handed a field that the schema lacks refuses it, as a ROS 2 message
# does on assignment; so does one that is handed 1.9 for an int32.
# Seen: `write_message` takes what it knows and leaves the rest out: `{"Z": 3.0}`, a field left out
# and `None` are all written as z = 0.0, `"1.5"` in quotes is 1.5, and 1.9 and -1.9 are cut to 1
# and -1. No error and no warning; the file is sound.
# So: compare the keys with the schema before writing (`set(message) == set(fields)`), and read one
# message back.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap-ros2-support==0.6.0 mcap==1.6.0
"$dir/venv/bin/python" - <<'PY'
import io
import sys
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer

given = [{"z": 3.0, "count": 2}, {"Z": 3.0, "count": 2}, {"count": 2}, {"z": None, "count": 2},
         {"z": "1.5", "count": 1.9}, {"z": 1.0, "count": -1.9}]
file = io.BytesIO()
writer = Writer(file)
schema = writer.register_msgdef("example_msgs/msg/Height", "float64 z\nint32 count\n")
for time, message in enumerate(given):
    writer.write_message(topic="/height", schema=schema, message=message, log_time=time, publish_time=time)
writer.finish()
file.seek(0)
found = [(m.ros_msg.z, m.ros_msg.count) for m in read_ros2_messages(file)]
for message, read in zip(given, found):
    print(message, "-> z, count", read)
if found != [(3.0, 2), (0.0, 2), (0.0, 2), (0.0, 2), (1.5, 1), (1.0, -1)]:
    sys.exit("changed: read are %s" % found)
PY
