#!/usr/bin/env bash
# ros2_numpy 0.0.5: intensities of a point cloud are bytes of its coordinates.
#
# Expected: `numpify(PointCloud2)` gives each field as its PointField says: intensity as float32 at
# offset 12, as LiDAR drivers publish it.
# Seen: the place of the field in the list (3 of x, y, z, intensity) is taken for an offset in
# bytes, and two bytes from there for an unsigned integer: the last byte of x and the first of y.
# Points at 1, 2 and 3 m with intensities 10, 20 and 30 have 63, 64 and 64. The colours of `rgb` are
# three such bytes. x, y and z are the first 12 bytes, whatever is there: with intensity first, x is
# the intensity. Offsets, types, rows and the order of bytes are not read.
# So: `np.frombuffer` with a dtype made of `fields` and `point_step`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check ros2-numpy==0.0.5 \
    transformations==2026.1.18 ros-sensor-msgs==5.5.1 ros-nav-msgs==5.5.1 ros-geometry-msgs==5.5.1 numpy==1.24.2
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
from ros2_numpy import numpify
from sensor_msgs.msg import PointCloud2, PointField

def read(*names):
    points = np.zeros(3, dtype=[(name, "<f4") for name in names])
    points["x"], points["intensity"] = [1, 2, 3], [10, 20, 30]
    fields = [PointField(name=name, offset=4 * at, datatype=PointField.FLOAT32, count=1) for at, name in enumerate(names)]
    cloud = PointCloud2(height=1, width=3, point_step=16, row_step=48, fields=fields)
    cloud.data = points.tobytes()
    found = numpify(cloud)
    xs, intensities = found["xyz"][:, 0].tolist(), found["intensity"].ravel().tolist()
    print(" ".join(names), "-> x", xs, "intensity", intensities)
    return xs, intensities

usual, other = read("x", "y", "z", "intensity"), read("intensity", "x", "y", "z")
if usual != ([1, 2, 3], [63, 64, 64]) or other[0] != [10, 20, 30]:
    sys.exit("changed: x and intensities are %s and %s" % (usual, other))
PY
