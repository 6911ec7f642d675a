#!/usr/bin/env bash
# Open3D 0.20.0: a depth image in metres (32FC1) makes a cloud of millimetres, and one function of
# the two honours the limit of distance.
#
# Expected: REP 118's two forms, 16-bit millimetres and floats in metres, of one scene give one
# cloud; `depth_scale=1000` turns integers into metres; `depth_trunc=3` cuts at 3 m.
# Seen: floats are divided by 1000 as well, in the old and in the tensor API: a wall at 5 m is at 5
# mm, and no limit finds it. With 16 bits the tensor API drops the wall (its limit is 3 m by
# default), the old API keeps it (its limit is 1000 m).
# So: give both, `depth_scale=1.0` for floats and the limit of the sensor; look at the bounds of the
# first cloud.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import open3d as o3d

camera = o3d.camera.PinholeCameraIntrinsic(4, 3, 2.0, 2.0, 1.5, 1.0)
matrix = o3d.core.Tensor(camera.intrinsic_matrix)
metres = np.full((3, 4), 2.0, np.float32)
metres[1] = 5.0
millimetres = (metres * 1000).astype(np.uint16)

def old(image, **options):
    cloud = o3d.geometry.PointCloud.create_from_depth_image(o3d.geometry.Image(image), camera, **options)
    return sorted(set(np.round(np.asarray(cloud.points)[:, 2], 4).tolist()))

def tensor(image, **options):
    cloud = o3d.t.geometry.PointCloud.create_from_depth_image(o3d.t.geometry.Image(image), matrix, **options)
    return sorted(set(np.round(cloud.point.positions.numpy()[:, 2].astype(float), 4).tolist()))

found = {
    "16 bits": (old(millimetres), tensor(millimetres)),
    "floats": (old(metres), tensor(metres)),
    "floats, scale 1": (old(metres, depth_scale=1.0), tensor(metres, depth_scale=1.0)),
}
print("distances in the cloud of walls at 2 m and 5 m:")
for name, (first, second) in found.items():
    print(f"{name}: old API {first} | tensor API {second}")
if found["16 bits"] != ([2.0, 5.0], [2.0]):
    sys.exit("changed: 16 bits give %s" % (found["16 bits"],))
if found["floats"] != ([0.002, 0.005], [0.002, 0.005]):
    sys.exit("changed: floats give %s" % (found["floats"],))
if found["floats, scale 1"] != ([2.0, 5.0], [2.0]):
    sys.exit("changed: floats with scale 1 give %s" % (found["floats, scale 1"],))
PY
