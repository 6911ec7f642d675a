#!/usr/bin/env bash
# rosbags 0.11.9: a ROS 1 bag that it wrote with `latching=True` it cannot open.
#
# Expected: `add_connection(..., latching=...)` takes an int; True is one in Python, and the name
# asks for it. The file is valid.
# Seen: writing ends without a word, with the text "True" in the connection's header; `Reader.open`
# raises ValueError at it: the whole bag is closed to it, also the connections that are not latched.
# With `latching=1` all is well.
# So: write 1 and 0; open each bag once after writing.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rosbags==0.11.9
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS1_NOETIC)
kind = "std_msgs/msg/Int32"

def attempt(name, latching):
    path = f"{sys.argv[1]}/{name}.bag"
    with Writer(path) as writer:
        latched = writer.add_connection("/map", kind, typestore=store, latching=latching)
        other = writer.add_connection("/tick", kind, typestore=store)
        for connection in (latched, other):
            writer.write(connection, 1, store.serialize_ros1(store.types[kind](5), kind))
    try:
        with Reader(path) as reader:
            return sum(1 for _ in reader.messages())
    except ValueError as error:
        return str(error)

found = {"1": attempt("one", 1), "True": attempt("true", True)}
for latching, result in found.items():
    print(f"latching={latching}: {result}")
if found["1"] != 2 or "'True'" not in str(found["True"]):
    sys.exit("changed: it is %s" % found)
PY
