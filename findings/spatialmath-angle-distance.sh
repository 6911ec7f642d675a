#!/usr/bin/env bash
# spatialmath-python 1.1.18: the angle between two headings 90 degrees apart is 90 degrees, or 45.
#
# Expected: `angdist` of one name gives the angle of the rotation between two orientations, whatever
# class they are kept in.
# Seen: by default an SO3 gives 90 degrees, a UnitQuaternion of the same rotation 45 (the angle
# between the two vectors of four numbers; its default is metric 3, that of SO3 is metric 6). Metric
# 6, asked of a UnitQuaternion, raises UnboundLocalError; metric 4 is the full angle in both.
# So: name the metric (4), or halve nothing and compute it from the matrices.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check spatialmath-python==1.1.18
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
from spatialmath import SO3, UnitQuaternion

def angle(kind, **options):
    first, second = kind(SO3()), kind(SO3.Rz(90, unit="deg"))
    try:
        return round(float(np.degrees(first.angdist(second, **options))), 3)
    except UnboundLocalError:
        return "UnboundLocalError"

found = {name: {"by default": angle(kind), "metric 4": angle(kind, metric=4), "metric 6": angle(kind, metric=6)}
         for name, kind in (("SO3", SO3), ("UnitQuaternion", UnitQuaternion))}
for name, angles in found.items():
    print(name, angles)
if list(found["SO3"].values()) != [90.0, 90.0, 90.0]:
    sys.exit("changed: SO3 gives %s" % found["SO3"])
if list(found["UnitQuaternion"].values()) != [45.0, 90.0, "UnboundLocalError"]:
    sys.exit("changed: UnitQuaternion gives %s" % found["UnitQuaternion"])
PY
