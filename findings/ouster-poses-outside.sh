#!/usr/bin/env bash
# ouster-sdk 1.0.1: interpolated poses go on where the trajectory has ended, and turn round it.
#
# Expected: `interp_pose` gives poses between the known ones; outside it refuses, as
# `pose_at_timestamp` of the same library does ("ValueError if the timestamp cannot be
# bracketed"), or holds the last.
# Seen: the first and the last pair are prolonged without limit or warning. A robot whose log ends
# at 1 s after a turn of 1 rad has turned by 5 rad at 5 s; between two poses it follows an arc, so
# that half-way from x = 0 to x = 1 it is 0.13 m beside the line.
# So: cut a cloud to the time of its trajectory before de-warping; a scan that began before the
# first pose is bent, not left out.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ouster-sdk==1.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from ouster.sdk import core

def pose(x, turn):
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    matrix[0, 3] = x
    return matrix

times, known = np.array([0.0, 1.0]), np.stack([pose(0, 0), pose(1, 1)])
found = {}
for time in (-1.0, 0.5, 1.0, 2.0, 5.0):
    matrix = core.interp_pose(np.array([time]), times, known)[0]
    turn = np.arctan2(matrix[1, 0], matrix[0, 0])
    found[time] = [round(float(value), 2) for value in (matrix[0, 3], matrix[1, 3], turn % (2 * np.pi))]
    print(f"at {time} s of 0 .. 1: x, y, heading {found[time]}")
if found[1.0] != [1.0, 0.0, 1.0] or found[0.5] != [0.5, -0.13, 0.5]:
    sys.exit("changed: inside it is %s" % found)
if found[-1.0][2] != round(2 * np.pi - 1, 2) or found[2.0][2] != 2.0 or found[5.0][2] != 5.0:
    sys.exit("changed: outside it is %s" % found)
PY
