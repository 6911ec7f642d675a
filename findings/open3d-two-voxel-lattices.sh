#!/usr/bin/env bash
# Open3D 0.20.0: its two voxel filters have two lattices, and one more point moves the cells of all
# others.
#
# Expected: a point belongs to the cell floor(x / size), so that two scans of one room share cells,
# and `voxel_down_sample` of `open3d.geometry` and `open3d.t.geometry` are one filter.
# Seen: the older one, and VoxelGrid, start half a cell below the lowest point of each cloud. With
# one point at -0.2 m added, the point at 1.1 m is no longer alone in its cell and merges with 1.4.
# The newer one (open3d.t) has its lattice at zero, and the old cells stay.
# So: grid indices of two VoxelGrids cannot be compared; use open3d.t, or
# create_from_point_cloud_within_bounds with bounds of your own, for maps that grow.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import open3d as o3d

def filtered(xs):
    points = np.array([[x, 0.0, 0.0] for x in xs])
    old = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    new = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    grid = o3d.geometry.VoxelGrid.create_from_point_cloud(old, 0.5)
    tidy = lambda array: sorted(round(float(x), 3) for x in np.asarray(array)[:, 0])
    return (tidy(old.voxel_down_sample(0.5).points), tidy(new.voxel_down_sample(0.5).point.positions.numpy()),
            [int(grid.get_voxel(np.array([x, 0.0, 0.0]))[0]) for x in (0.1, 1.1, 1.4)])

few = filtered([0.1, 0.4, 0.6, 1.1, 1.4])
more = filtered([-0.2, 0.1, 0.4, 0.6, 1.1, 1.4])
for name, (old, new, cells) in (("five points", few), ("one more at -0.2 m", more)):
    print(f"{name}: geometry {old} | t.geometry {new} | cells of 0.1, 1.1 and 1.4 m in a VoxelGrid {cells}")
if few != ([0.1, 0.5, 1.1, 1.4], [0.25, 0.6, 1.25], [0, 2, 3]):
    sys.exit("changed: five points give %s" % (few,))
if more != ([-0.2, 0.25, 0.6, 1.25], [-0.2, 0.25, 0.6, 1.25], [1, 3, 3]):
    sys.exit("changed: six points give %s" % (more,))
PY
