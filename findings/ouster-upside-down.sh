#!/usr/bin/env bash
# ouster-sdk 1.0.1: a sensor that hangs exactly upside down is said to be level.
#
# Expected: `get_rot_matrix_to_align_to_gravity` "aligns acceleration to gravity [0, 0, 1]": for the
# acceleration (0, 0, -9.8) of a LiDAR on a ceiling the matrix turns it over.
# Seen: it is the identity, so the cloud keeps its floor on top, for that one vector alone: with
# 0.01 in x or y it turns over as it should. (For no acceleration at all it is the identity too.)
# So: real sensors never measure that vector, simulated ones always do; check that the matrix times
# the acceleration points up.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ouster-sdk==1.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from ouster.sdk import core

up = {}
for acceleration in ((0, 0, 9.8), (9.8, 0, 0), (0.01, 0, -9.8), (0, 0.01, -9.8), (0, 0, -9.8)):
    for fix_yaw in (True, False):
        turned = core.get_rot_matrix_to_align_to_gravity(*acceleration, fix_yaw=fix_yaw) @ np.array(acceleration)
        up[acceleration, fix_yaw] = bool(turned[2] > 9.7)
        print(acceleration, "fix_yaw" if fix_yaw else "", "->", turned.round(3).tolist())
wrong = {acceleration for (acceleration, _), points_up in up.items() if not points_up}
if wrong != {(0, 0, -9.8)} or up[(0, 0, -9.8), True] or up[(0, 0, -9.8), False]:
    sys.exit("changed: not aligned are %s" % wrong)
PY
