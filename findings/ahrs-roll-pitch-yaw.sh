#!/usr/bin/env bash
# ahrs 0.4.0: `rpy=[roll, pitch, yaw]` of its two classes are two rotations, and the angles do not
# come back.
#
# Expected: `DCM(rpy=...)` ("array with roll->pitch->yaw angles") and `Quaternion(rpy=...)` are one
# rotation, and `DCM.to_rpy()` undoes `DCM(rpy=...)`.
# Seen: Quaternion turns by yaw about z, then pitch about y, then roll about x. DCM takes the first
# number, the roll, about z and the third, the yaw, about x. `to_rpy` of the matrix then gives
# three angles of neither order nor sign: for pure yaw 0.3 the DCM rolls by 0.3, and to_rpy says
# -0.3 of roll.
# So: build a DCM from `Quaternion(rpy=...).to_DCM()` or `DCM(euler=("zyx", [yaw, pitch, roll]))`;
# check conventions with a pure yaw and with three different angles.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ahrs==0.4.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from ahrs import DCM, Quaternion

def about(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix

angles = [0.1, 0.2, 0.3]
usual = about(2, 0.3) @ about(1, 0.2) @ about(0, 0.1)
swapped = about(2, 0.1) @ about(1, 0.2) @ about(0, 0.3)
q, m = Quaternion(rpy=angles).to_DCM(), np.asarray(DCM(rpy=angles))
back = DCM(rpy=angles).to_rpy().round(3).tolist()
yaw = DCM(rpy=[0, 0, 0.3])
print("Quaternion(rpy) is Rz(yaw) Ry(pitch) Rx(roll):", np.allclose(q, usual))
print("DCM(rpy) is the same:", np.allclose(m, usual), "| is Rz(roll) Ry(pitch) Rx(yaw):", np.allclose(m, swapped))
print("DCM(rpy=[0.1, 0.2, 0.3]).to_rpy():", back)
print("DCM(rpy=[0, 0, 0.3]) rolls:", np.allclose(yaw, about(0, 0.3)), "| to_rpy:", yaw.to_rpy().round(3).tolist())
if not np.allclose(q, usual) or not np.allclose(m, swapped) or np.allclose(m, usual):
    sys.exit("changed: the orders of rotation are others")
if not np.allclose(yaw, about(0, 0.3)) or not np.allclose(yaw.to_rpy(), [-0.3, 0, 0]):
    sys.exit("changed: pure yaw is another")
if np.allclose(back, angles) or np.allclose(back, angles[::-1]):
    sys.exit("changed: the angles come back as %s" % back)
PY
