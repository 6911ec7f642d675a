#!/usr/bin/env bash
# Open3D 0.20.0: if the first point is NaN, downsampling leaves one point, NaN; if one in the
# middle is, the bounds of the tensor cloud forget what stands before it.
#
# Expected: points without return in an organised cloud (NaN, as PCL and ROS drivers write them)
# are skipped, or are an error; where they stand does not matter.
# Seen: `voxel_down_sample` of [NaN, a, b] is [NaN], of [a, NaN, b] it is a, b and NaN.
# `get_min_bound` is NaN if the first point is, and right otherwise; in `open3d.t` it is NaN if the
# last is, and for [a, NaN, b] it is b, though a is smaller. PCD files are read with their NaN
# points by default.
# So: a corner of the image decides whether a map comes out empty. Call remove_non_finite_points
# first; a test needs the NaN at the first and at the last place.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import open3d

none, a, b = [np.nan] * 3, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]
found = {}
for name, points in {"first": [none, a, b], "middle": [a, none, b], "last": [a, b, none]}.items():
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    left = np.asarray(cloud.voxel_down_sample(1.0).points)
    tensor = open3d.t.geometry.PointCloud(open3d.core.Tensor(np.array(points)))
    found[name] = (int(np.isfinite(left).all(axis=1).sum()), len(left),
                   str(float(cloud.get_min_bound()[0])), str(float(tensor.get_min_bound().numpy()[0])))
    print(f"NaN {name}: {found[name][0]} of 2 points left (of {found[name][1]} in the result),",
          f"least x: {found[name][2]}, by the tensor API {found[name][3]}")
if found["first"][:3] != (0, 1, "nan") or found["middle"][:3] != (2, 3, "1.0") or found["last"][:3] != (2, 3, "1.0"):
    sys.exit("changed: downsampling gives %s" % found)
if [found[name][3] for name in ("first", "middle", "last")] != ["1.0", "4.0", "nan"]:
    sys.exit("changed: tensor bounds are %s" % found)
PY
