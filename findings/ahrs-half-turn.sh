#!/usr/bin/env bash
# ahrs 0.4.0: Chiaverini's method makes a half turn no turn at all, and in an array NaN.
#
# Expected: `DCM.to_quaternion(method="chiaverini")` follows the formula of its documentation, whose
# sign of 0 is 1: a rotation by 180 degrees about z is (0, 0, 0, 1), as with the four other methods.
# Seen: the code's sign of 0 is 0, so all components vanish, and a matrix alone becomes the identity
# (1, 0, 0, 0) without a warning. The same matrix in an array of two becomes four NaN. At 179.9
# degrees all is well.
# So: a robot that turned round in a corridor faces forward again; keep to the default
# ("shepperd"), and try conversions at exactly half a circle about each axis.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ahrs==0.4.0
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings
import numpy as np
from ahrs import DCM
from ahrs.common.orientation import chiaverini

warnings.simplefilter("ignore")
methods = ("chiaverini", "shepperd", "hughes", "itzhack", "sarabandi")
turns = {"x": np.diag([1.0, -1, -1]), "y": np.diag([-1.0, 1, -1]), "z": np.diag([-1.0, -1, 1])}
alone, right = {}, {}
for i, (axis, matrix) in enumerate(turns.items()):
    quaternions = {m: np.asarray(DCM(matrix).to_quaternion(method=m)) for m in methods}
    alone[axis] = quaternions["chiaverini"].tolist()
    right[axis] = [m for m, q in quaternions.items() if abs(q[i + 1]) > 0.999]
    print("180 degrees about", axis, "-> chiaverini", alone[axis], "| right:", right[axis])
array = chiaverini(np.stack([turns["z"], np.eye(3)])).tolist()
near = np.asarray(DCM(z=np.radians(179.9)).to_quaternion(method="chiaverini")).round(3).tolist()
print("in an array:", array, "| at 179.9 degrees:", near)
if any(q != [1.0, 0.0, 0.0, 0.0] for q in alone.values()) or any(r != list(methods[1:]) for r in right.values()):
    sys.exit("changed: alone it is %s, right are %s" % (alone, right))
if not np.isnan(array[0]).all() or near != [0.001, 0.0, 0.0, 1.0]:
    sys.exit("changed: in an array it is %s, near by %s" % (array, near))
PY
