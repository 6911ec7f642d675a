#!/usr/bin/env bash
# A robot that drove 1 m straight ahead in x while it turned by 90 degrees was half-way beside its
# line, in pytransform3d 3.17.0 and gtsam 4.3.0.
#
# Expected: a transform buffer, asked between two stamps, interpolates the place linearly and the
# rotation spherically, as tf2 does.
# Seen: `NumpyTimeseriesTransform` of pytransform3d and `Pose3.slerp` of gtsam move along a screw
# (the first says so in its documentation, the other is called slerp): 0.21 m off the line for a
# step of 1 m and a quarter turn. A pose that is asked for in another parent frame moves otherwise
# with tf2's rule, so neither is "the" path; one recording gives two maps.
# So: sample poses as densely as the points, or interpolate place and rotation by hand where results
# are to be compared with tf2.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pytransform3d==3.17.0 gtsam==4.3.0
"$dir/venv/bin/python" - <<'PY'
import sys
import gtsam
import numpy as np
from pytransform3d.transform_manager import NumpyTimeseriesTransform, TemporalTransformManager

turn = np.radians(90)
poses = np.array([[0, 0, 0, 1, 0, 0, 0], [1, 0, 0, np.cos(turn / 2), 0, 0, np.sin(turn / 2)]])
manager = TemporalTransformManager()
manager.add_transform("robot", "world", NumpyTimeseriesTransform(np.array([0.0, 1.0]), poses))
pose = lambda row: gtsam.Pose3(gtsam.Rot3(*row[3:]), row[:3])
linear = (poses[0, :3] + poses[1, :3]) / 2
found = {"place interpolated linearly": linear,
         "pytransform3d": manager.get_transform_at_time("robot", "world", 0.5)[:3, 3],
         "gtsam": pose(poses[0]).slerp(0.5, pose(poses[1])).translation()}
found = {name: (np.round(place, 3) + 0.0).tolist() for name, place in found.items()}
for name, place in found.items():
    print(f"{name}: {place}")
if found["pytransform3d"] != [0.5, -0.207, 0.0] or found["gtsam"] != [0.5, -0.207, 0.0]:
    sys.exit("changed: places are %s" % found)
PY
