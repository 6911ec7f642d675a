#!/usr/bin/env bash
# rosbags 0.11.9: asked for the messages of a topic that is not recorded, it gives all of all
# topics.
#
# Expected: `messages(connections=[c for c in reader.connections if c.topic == "/scan"])`, the form
# of its documentation, yields nothing if there is no /scan. The duration of a recording from 10 s
# to 30 s is 20 s; one without messages has no start, or raises.
# Seen: an empty list of connections means "no filter": what comes is the odometry, with the right
# type name in each connection and nothing to show that it was not asked for, in ROS 1 and ROS 2
# recordings. The end is one nanosecond after the last message. A recording without messages starts
# in the year 2262, at 2^63 - 1 ns.
# So: raise if the list is empty before reading; counts of a topic that a robot lacks are otherwise
# those of the whole recording.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rosbags==0.11.9
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
from pathlib import Path
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

folder, found = Path(sys.argv[1]), {}

def record(kind, name, stamps):
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    path = folder / f"{name}_{kind}{'.bag' if ros1 else ''}"
    writer = rosbag1.Writer(path) if ros1 else rosbag2.Writer(
        path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3)
    text = store.types["std_msgs/msg/String"]("")
    raw = store.serialize_ros1(text, text.__msgtype__) if ros1 else store.serialize_cdr(text, text.__msgtype__)
    with writer:
        connection = writer.add_connection("/odom", text.__msgtype__, typestore=store)
        for stamp in stamps:
            writer.write(connection, stamp, raw)
    return (rosbag1 if ros1 else rosbag2).Reader(path)

for kind in ("ros1", "sqlite3", "mcap"):
    with record(kind, "drive", (10, 20, 30)) as reader:
        topics = [c.topic for c, *_ in reader.messages(connections=[c for c in reader.connections if c.topic == "/scan"])]
        found[kind] = topics, reader.duration
    print(f"{kind}: messages of /scan {topics}, from 10 to 30 ns a duration of {found[kind][1]} ns")
with record("mcap", "none", ()) as reader:
    found["start"] = reader.start_time
print("without messages it starts at", found["start"])
if any(found[kind] != (["/odom"] * 3, 21) for kind in ("ros1", "sqlite3", "mcap")):
    sys.exit("changed: %s" % found)
if found["start"] != 2**63 - 1:
    sys.exit("changed: a recording without messages starts at %s" % found["start"])
PY
