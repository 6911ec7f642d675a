#!/usr/bin/env bash
# pyquaternion 0.9.9: `yaw_pitch_roll` are not the yaw, pitch and roll of ROS, though documented so.
#
# Expected: "intrinsic Tait-Bryan angles following the z-y'-x'' convention", as REP 103 and the
# aerospace texts have it: q = Rz(yaw) Ry(pitch) Rx(roll) gives (yaw, pitch, roll) back.
# Seen: (0.3, 0.2, 0.1) comes back as (0.286, 0.220, 0.038); it is q = Rx(roll) Ry(pitch) Rz(yaw)
# that comes back whole, which is x-y'-z''. On level ground both agree, so the fault is met on
# the first slope.
# So: take the heading from the rotation matrix, atan2(R10, R00); never test a conversion with one
# angle at a time.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyquaternion==0.9.9
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from pyquaternion import Quaternion

about = lambda axis, angle: Quaternion(axis=axis, angle=angle)
x, y, z = np.eye(3)
told = lambda q: [round(float(angle), 3) for angle in q.yaw_pitch_roll]
zyx = about(z, 0.3) * about(y, 0.2) * about(x, 0.1)
xyz = about(x, 0.1) * about(y, 0.2) * about(z, 0.3)
matrix = zyx.rotation_matrix
heading = round(float(np.arctan2(matrix[1, 0], matrix[0, 0])), 3)
print("Rz(0.3) Ry(0.2) Rx(0.1):", told(zyx), "| heading of its matrix:", heading)
print("Rx(0.1) Ry(0.2) Rz(0.3):", told(xyz))
print("level, yaw 0.3:         ", told(about(z, 0.3)))
if told(zyx) != [0.286, 0.22, 0.038] or told(xyz) != [0.3, 0.2, 0.1] or heading != 0.3:
    sys.exit("changed: angles are %s and %s" % (told(zyx), told(xyz)))
PY
