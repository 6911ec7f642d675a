#!/usr/bin/env bash
# trimesh 5.2.0: `VoxelGrid.marching_cubes` is in cells, not in metres, and not where the grid is.
#
# Expected: a surface of a grid lies at the grid, as `as_boxes()` and `points` do.
# Seen: the transform of the grid (pitch and origin) is not applied: a block of 1 m at x = 10 m in
# cells of 0.5 m has a surface of 2 units at the origin. And a solid block of 2 x 2 x 2 cells has
# 5.67 cells of volume, as the surface passes half-way to the centres of the free cells and its
# edges are cut.
# So: `mesh.apply_transform(grid.transform)` by hand; take volumes and clearances from `as_boxes()`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trimesh==5.2.0 scikit-image==0.26.0
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import trimesh

cells = np.zeros((4, 4, 4), bool)
cells[1:3, 1:3, 1:3] = True
grid = trimesh.voxel.VoxelGrid(cells, transform=trimesh.transformations.scale_and_translate(0.5, [10, 0, 0]))
boxes, surface = grid.as_boxes(), grid.marching_cubes
placed = surface.copy()
placed.apply_transform(grid.transform)
x = lambda mesh: mesh.bounds[:, 0].round(3).tolist()
print("x of boxes:", x(boxes), "| of the surface:", x(surface), "| after the transform:", x(placed))
print("volume of the cells:", round(grid.volume, 3), "| of the surface in cells:", round(surface.volume, 3))
if x(boxes) != [10.25, 11.25] or x(surface) != [0.5, 2.5] or x(placed) != [10.25, 11.25]:
    sys.exit("changed: bounds are %s, %s and %s" % (x(boxes), x(surface), x(placed)))
if round(surface.volume, 2) != 5.67:
    sys.exit("changed: the volume is %s" % surface.volume)
PY
