#!/usr/bin/env bash
# Half-way between two headings 90 degrees apart: four libraries, two answers 180 degrees apart.
#
# Expected: q and -q are one rotation (a recorded trajectory changes sign as it likes), so an
# interpolation between identity and a quarter turn is 45 degrees whichever sign is written.
# Seen: with the second quaternion negated pyquaternion 0.9.9 and evo 1.38.1's transformations take
# the short way (45 degrees); pytransform3d 3.17.0, quaternionic 1.0.18 and
# spatialmath-python 1.1.18's `qslerp` go round the back (225 degrees) unless told, in the first and
# the last by `shortest_path=True` and `shortest=True`. spatialmath's class UnitQuaternion, above
# the same function, hides it by making the real part positive when it is built.
# So: flip signs until neighbours have a positive dot product before resampling poses, or one
# missed line of a log makes the robot spin.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    pyquaternion==0.9.9 pytransform3d==3.17.0 quaternionic==1.0.18 spatialmath-python==1.1.18 evo==1.38.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings
import numpy as np

warnings.simplefilter("ignore")
import evo.core.transformations
import pyquaternion
import pytransform3d.rotations
import quaternionic
import spatialmath
import spatialmath.base

here, there = np.array([1.0, 0, 0, 0]), np.array([0.5 ** 0.5, 0, 0, 0.5 ** 0.5])
libraries = {
    "pyquaternion": lambda a, b: pyquaternion.Quaternion.slerp(
        pyquaternion.Quaternion(a), pyquaternion.Quaternion(b), 0.5).elements,
    "evo": lambda a, b: evo.core.transformations.quaternion_slerp(a, b, 0.5),
    "pytransform3d": lambda a, b: pytransform3d.rotations.quaternion_slerp(a, b, 0.5),
    "pytransform3d, shortest_path": lambda a, b: pytransform3d.rotations.quaternion_slerp(
        a, b, 0.5, shortest_path=True),
    "quaternionic": lambda a, b: quaternionic.slerp(quaternionic.array(a), quaternionic.array(b), 0.5).ndarray,
    "spatialmath qslerp": lambda a, b: spatialmath.base.qslerp(a, b, 0.5),
    "spatialmath qslerp, shortest": lambda a, b: spatialmath.base.qslerp(a, b, 0.5, shortest=True),
    "spatialmath UnitQuaternion": lambda a, b: spatialmath.UnitQuaternion(a).interp(
        spatialmath.UnitQuaternion(b), 3)[1].vec,
}
heading = lambda q: round(float(np.degrees(2 * np.arctan2(q[3], q[0]))) % 360, 3)
found = {}
for name, slerp in libraries.items():
    found[name] = [heading(np.asarray(slerp(here, sign * there))) for sign in (1, -1)]
    print(f"{name}: 0 to 90 degrees at half: {found[name][0]}, with the sign flipped: {found[name][1]}")
long_way = {"pytransform3d", "quaternionic", "spatialmath qslerp"}
for name, angles in found.items():
    if angles != [45.0, 225.0 if name in long_way else 45.0]:
        sys.exit("changed: %s gives %s" % (name, angles))
PY
