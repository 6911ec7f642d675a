#!/usr/bin/env bash
# pytransform3d 3.17.0: a joint beyond its limit stops there, without a word.
#
# Expected: `set_joint("j", 2.0)` of a joint with limits of -1 and 1 turns it by 2 rad, as measured,
# or is an error.
# Seen: it turns by 1 rad. An encoder that is off by a turn, or one degree beyond a limit written
# too narrow, moves the sensor behind it, and nothing says so.
# So: compare with `get_joint_limits` before.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pytransform3d==3.17.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import math
import sys
import warnings
from pytransform3d.urdf import UrdfTransformManager

ROBOT = """<robot name="r"><link name="base"/><link name="lidar"/><joint name="j" type="revolute"><parent link="base"/>
<child link="lidar"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
robot = UrdfTransformManager()
robot.load_urdf(ROBOT)
with warnings.catch_warnings(record=True) as warned:
    warnings.simplefilter("always")
    robot.set_joint("j", 2.0)
turned = robot.get_transform("lidar", "base")
angle = round(math.atan2(turned[1, 0], turned[0, 0]), 9)
print("asked for 2.0 rad, turned by %s rad, warnings: %d" % (angle, len(warned)))
if (angle, len(warned)) != (1.0, 0):
    sys.exit("changed: %s rad, %d warnings" % (angle, len(warned)))
PY
