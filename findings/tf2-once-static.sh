#!/usr/bin/env bash
# tf2 0.7.6 (Debian 12, Python): a frame that was static once has one pose for all times, whatever
# is published later; and every answer of `set_transform` is None.
#
# Expected: a stamped transform of a frame holds for its stamp: at 5 s the robot is where it was at
# 5 s, before that the lookup raises ExtrapolationException.
# Seen: if the first transform of a frame was static (a calibration, a start pose), all that follow
# by `set_transform` replace that one pose: at 1 s, 5 s and 99 s the robot is where it was last. In
# the other order the static one is a single sample with a stamp. No exception and no message. A
# repeated or too old stamp is refused, with a warning on standard error only.
# So: never publish one child frame on both topics, and look for it first when old scans are drawn
# at the newest pose.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-tf2=0.7.6-1+b2 python3-geometry-msgs python3-rospy >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - 2>"$dir/log" <<'PY'
import sys
import rospy
import tf2_py
from geometry_msgs.msg import TransformStamped

def transform(stamp, x):
    message = TransformStamped(child_frame_id="robot")
    message.header.frame_id, message.header.stamp = "map", rospy.Time(stamp)
    message.transform.translation.x, message.transform.rotation.w = x, 1
    return message

def x_at(buffer, stamp):
    try:
        return buffer.lookup_transform_core("map", "robot", rospy.Time(stamp)).transform.translation.x
    except tf2_py.ExtrapolationException:
        return None

found, answers = {}, set()
for order in ("moving", "static, moving", "moving, static"):
    buffer = tf2_py.BufferCore(rospy.Duration(100))
    if order.startswith("static"):
        buffer.set_transform_static(transform(0, -1.0), "a")
    for stamp in (5, 6, 6, 7):
        answers.add(buffer.set_transform(transform(stamp, float(stamp)), "a"))
    if order.endswith("static"):
        buffer.set_transform_static(transform(8, 8.0), "a")
    found[order] = [x_at(buffer, stamp) for stamp in (1, 5, 6, 8, 99)]
    print(f"{order}: x at 1, 5, 6, 8 and 99 s is {found[order]}")
print("set_transform answers", answers)
if found != {"moving": [None, 5.0, 6.0, None, None], "static, moving": [7.0] * 5, "moving, static": [None, 5.0, 6.0, 8.0, None]}:
    sys.exit("changed: %s" % found)
if answers != {None}:
    sys.exit("changed: answers are %s" % answers)
PY
