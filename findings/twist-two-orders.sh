#!/usr/bin/env bash
# Six numbers of a twist: SciPy 1.17.1, pytransform3d 3.17.0 and gtsam 4.3.0 against
# spatialmath-python 1.1.18.
#
# Expected: the exponential of (1, 0, 0, 0, 0, pi/2) is one rigid motion.
# Seen: SciPy's `RigidTransform.from_exp_coords`, pytransform3d and gtsam's `Pose3.Expmap` take the
# rotation first and turn by 1 rad about x, spatialmath's `SE3.Exp` takes the translation first and
# turns by 90 degrees about z. Nothing can tell them by their shape, and a covariance of 6 x 6 has
# the same two orders: variances of radians become those of metres. gtsam's own Pose2 has x, y first
# and the angle last.
# So: name the six at each border, or pass matrices; test with a motion along one axis only.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    scipy==1.17.1 pytransform3d==3.17.0 gtsam==4.3.0 spatialmath-python==1.1.18
"$dir/venv/bin/python" - <<'PY'
import sys
import gtsam
import numpy as np
from pytransform3d.transformations import transform_from_exponential_coordinates
from scipy.spatial.transform import RigidTransform, Rotation
from spatialmath import SE3

twist = np.array([1, 0, 0, 0, 0, np.pi / 2])
found = {
    "SciPy": RigidTransform.from_exp_coords(twist).as_matrix(),
    "pytransform3d": transform_from_exponential_coordinates(twist),
    "gtsam": gtsam.Pose3.Expmap(twist).matrix(),
    "spatialmath": SE3.Exp(twist).A,
}
for name, matrix in found.items():
    turn = np.degrees(Rotation.from_matrix(matrix[:3, :3]).as_rotvec())
    found[name] = (turn + 0.0).round(1).tolist(), (matrix[:3, 3] + 0.0).round(2).tolist()
    print(f"{name}: turns by {found[name][0]} degrees, moves by {found[name][1]}")
plane = gtsam.Pose2.Expmap(np.array([1, 0, 0]))
print("gtsam, Pose2 of (1, 0, 0):", plane.x(), plane.y(), plane.theta())
first, last = [57.3, 0, 0], [0, 0, 90]
if [turn for turn, _ in found.values()] != [first, first, first, last] or plane.x() != 1:
    sys.exit("changed: motions are %s" % found)
PY
