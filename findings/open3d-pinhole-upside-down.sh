#!/usr/bin/env bash
# Open3D 0.20.0: the picture of `create_rays_pinhole` with `up` upwards is turned by 180 degrees.
#
# Expected: of rays given by "center", "eye" and "up" the first row of the picture looks up and the
# first column left, as in its own `create_rays_pinhole(intrinsic_matrix, extrinsic_matrix, ...)`
# and in OpenCV, x right and y down.
# Seen: a camera that looks along x with z as up has its first row downwards and its first column
# to the right: a shelf on the left above is seen at the lower right. The form with matrices is as
# expected.
# So: hand -up, or turn the depth picture; the error hides in symmetrical scenes and in point
# clouds, which come out right either way.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import open3d as o3d

shelf = o3d.t.geometry.TriangleMesh.create_box(0.2, 2, 2).translate([4, 1, 1])  # left (+y), above (+z)
scene = o3d.t.geometry.RaycastingScene()
scene.add_triangles(shelf)

def seen(rays):
    rows, columns = np.nonzero(np.isfinite(scene.cast_rays(rays)["t_hit"].numpy()))
    return "above" if rows.mean() < 31.5 else "below", "left" if columns.mean() < 31.5 else "right"

pinhole = o3d.t.geometry.RaycastingScene.create_rays_pinhole
told = lambda up: pinhole(fov_deg=90, center=[1, 0, 0], eye=[0, 0, 0], up=up, width_px=64, height_px=64)
intrinsic = o3d.core.Tensor([[32.0, 0, 32], [0, 32, 32], [0, 0, 1]])
# Axes of the camera in the world: x right is -y, y down is -z, z ahead is x.
extrinsic = o3d.core.Tensor([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
found = {"up = z": seen(told([0, 0, 1])), "up = -z": seen(told([0, 0, -1])),
         "matrices": seen(pinhole(intrinsic, extrinsic, 64, 64))}
print("a shelf on the left above is seen:", found)
if found != {"up = z": ("below", "right"), "up = -z": ("above", "left"), "matrices": ("above", "left")}:
    sys.exit("changed: it is seen %s" % found)
PY
