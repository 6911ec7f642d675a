#!/usr/bin/env bash
# ros2_numpy 0.0.5: a pose that is not turned is a half turn, and every heading looks backwards.
#
# Expected: `numpify(Pose())` of ROS 2, with orientation x=0 y=0 z=0 w=1, is the identity, and
# `msgify(Pose, matrix)` is its inverse.
# Seen: x, y, z, w is handed to a library that takes w first: the identity becomes a half turn about
# z, and each robot on level ground, whatever its heading, looks to -x. The way back names w, x, y,
# z of that library x, y, z, w: the identity becomes a half turn about x. The two mistakes of Pose
# cancel, so that a test of the round trip passes. Of Transform the way there is wrong, the way back
# right.
# So: build matrices by SciPy's `Rotation.from_quat` from x, y, z, w.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ros2-numpy==0.0.5 \
    transformations==2026.1.18 ros-sensor-msgs==5.5.1 ros-nav-msgs==5.5.1 ros-geometry-msgs==5.5.1 numpy==1.24.2
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from geometry_msgs.msg import Pose, Quaternion, Transform
from ros2_numpy import msgify, numpify

def ahead(kind, **turn):
    """Where a robot's x axis points, by the matrix of a message."""
    message = Pose(orientation=Quaternion(**turn)) if kind is Pose else Transform(rotation=Quaternion(**turn))
    return [int(value) for value in numpify(message)[:3, 0].round()]

def numbers(turn):
    return [round(abs(value), 3) for value in (turn.x, turn.y, turn.z, turn.w)]

half = 0.5 ** 0.5
found = {
    "ahead of Pose not turned": ahead(Pose, w=1.0),
    "ahead of Transform not turned": ahead(Transform, w=1.0),
    "ahead of Pose a quarter to the left": ahead(Pose, z=half, w=half),
    "Pose of the identity, x y z w": numbers(msgify(Pose, np.eye(4)).orientation),
    "Transform of the identity, x y z w": numbers(msgify(Transform, np.eye(4)).rotation),
    "Pose a quarter to the left, there and back": numbers(
        msgify(Pose, numpify(Pose(orientation=Quaternion(z=half, w=half)))).orientation),
}
for name, values in found.items():
    print(f"{name}: {values}")
if list(found.values())[:2] != [[-1, 0, 0]] * 2 or list(found.values())[3:5] != [[1, 0, 0, 0], [0, 0, 0, 1]]:
    sys.exit("changed: %s" % found)
if list(found.values())[2] != [-1, 0, 0] or list(found.values())[5] != [0, 0, 0.707, 0.707]:
    sys.exit("changed: %s" % found)
PY
