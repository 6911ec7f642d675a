#!/usr/bin/env bash
# bagx 0.6.0 (Python): a sensor that comes a second late is in sync to a millisecond.
#
# Expected: `bagx sync BAG A B` ("Analyze time synchronization between two topics. Reports
# mean/max/median delay") reports some 1000 ms for an IMU whose messages are recorded a second
# after the odometry of the same instant.
# Seen: with both at 50 Hz, a lag of 50 ms is a mean of 10.1 ms, "good for most SLAM methods", as
# one of 10 ms is; the median and the P95 of a lag of 1 s are 0 and 1 ms, and its mean of 26 ms
# comes from the ends, where only one topic was recorded. Each message is compared with the
# nearest one of the other topic by the time of recording, which is never farther than half a
# period. The stamps in the headers, which say what belongs together, are not read.
# So: match by `header.stamp` and compare the times of recording, or correlate the signals.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check bagx==0.6.0 rosbags==0.11.9 mcap==1.6.0 mcap-ros2-support==0.6.0 numpy==2.4.6
cat >record.py <<'PY'
import sys
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

lag_ms = int(sys.argv[1])
store = get_typestore(Stores.ROS2_HUMBLE)
types = store.types

def header(stamp_ns, frame):
    time = types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
    return types["std_msgs/msg/Header"](time, frame)

vector, still = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
messages = []
for number in range(1000):
    stamp_ns = 10**12 + number * 20_000_000
    pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](0.02 * number, 0.0, 0.0), still)
    twist = types["geometry_msgs/msg/Twist"](vector(1.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    odometry = types["nav_msgs/msg/Odometry"](
        header(stamp_ns, "odom"), "base_link",
        types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        types["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)))
    imu = types["sensor_msgs/msg/Imu"](
        header(stamp_ns, "imu"), still, np.zeros(9), vector(0.0, 0.0, 0.1), np.zeros(9), vector(0.0, 0.0, 9.81), np.zeros(9))
    messages += [(stamp_ns, "/odom", odometry), (stamp_ns + lag_ms * 1_000_000, "/imu", imu)]
with Writer(f"lag_{sys.argv[1]}", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
    connections = {}
    for time_ns, topic, message in sorted(messages, key=lambda one: one[:2]):
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
        writer.write(connections[topic], time_ns, store.serialize_cdr(message, message.__msgtype__))
PY
for lag in 10 50 1000 1010; do
    "$dir/venv/bin/python" record.py $lag
    "$dir/venv/bin/bagx" sync "lag_$lag" /odom /imu --json "$lag.json" >log 2>&1 || { cat log; exit 1; }
    echo "$lag ms late:$(grep -o '[0-9.]*ms — .*' log)"
done
"$dir/venv/bin/python" - <<'PY'
import json, sys

found = {}
for lag in (10, 50, 1000, 1010):
    text = json.load(open(f"{lag}.json"))
    def numbers(value):
        if isinstance(value, dict):
            for key, inner in value.items():
                if "median" in key or "p95" in key:
                    yield key, inner
                else:
                    yield from numbers(inner)
        elif isinstance(value, list):
            for inner in value:
                yield from numbers(inner)
    found[lag] = dict(numbers(text))
    print(lag, found[lag])
if any(value > 11 for figures in found.values() for key, value in figures.items() if "ms" in key) or not all(found.values()):
    sys.exit("changed: %s" % found)
PY
