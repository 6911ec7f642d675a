#!/usr/bin/env bash
# transforms3d 0.4.2 and numpy-quaternion 2024.0.13 make a rotation of a mirrored frame; three
# others refuse.
#
# Expected: diag(1, 1, -1), a left-handed frame (a camera with z the wrong way, an OBJ of another
# tool), is no rotation, and turning it into a quaternion is an error, as in SciPy, pyquaternion
# and pytransform3d.
# Seen: transforms3d gives half a turn about y, numpy-quaternion no turn at all. Both are unit
# quaternions; nothing is raised. (tf_transformations of ROS 2 calls transforms3d.)
# So: check that the determinant is +1 before converting; a body that faces backwards after an
# import is this as often as a wrong axis.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check transforms3d==0.4.2 numpy-quaternion==2024.0.13 \
    scipy==1.17.1 pyquaternion==0.9.9 pytransform3d==3.17.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pyquaternion
import pytransform3d.rotations
import quaternion
import transforms3d
from scipy.spatial.transform import Rotation

mirror = np.diag([1.0, 1.0, -1.0])
found = {}
for name, convert in {
    "transforms3d": transforms3d.quaternions.mat2quat,
    "numpy-quaternion": lambda m: quaternion.as_float_array(quaternion.from_rotation_matrix(m)),
    "scipy": lambda m: Rotation.from_matrix(m).as_quat(),
    "pyquaternion": lambda m: pyquaternion.Quaternion(matrix=m).elements,
    "pytransform3d": pytransform3d.rotations.quaternion_from_matrix,
}.items():
    try:
        found[name] = (np.abs(convert(mirror)).round(6) + 0.0).tolist()
    except ValueError:
        found[name] = "refused"
    print(name, found[name])
if found["transforms3d"] != [0, 0, 1, 0] or found["numpy-quaternion"] != [1, 0, 0, 0]:
    sys.exit("changed: quaternions are %s" % found)
if [found[name] for name in ("scipy", "pyquaternion", "pytransform3d")] != ["refused"] * 3:
    sys.exit("changed: a mirror is taken by %s" % found)
PY
