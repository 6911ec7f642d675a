#!/usr/bin/env bash
# trimesh 5.2.0: it does not write the grid of an oblong room as .binvox, and does not read one in
# the order it offers.
#
# Expected: .binvox has three dimensions and one scale; a box of 2 x 3 x 4 m in cells of 0.5 m is
# such a grid. `axis_order="xyz"` is one of the two values that reading and writing name.
# Seen: the export raises "Can only export binvox with uniform scale", though the pitch is 0.5 in
# all directions: it compares the whole extents, so that only cubes of cells pass. Reading with
# `axis_order="xyz"` raises an error about the truth value of an array; with the default order a
# cube comes back as it was.
# So: pad the grid to a cube of cells before the export, and keep to the default order.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trimesh==5.2.0 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import io
import sys
import numpy as np
import trimesh

def attempt(cells, **options):
    grid = trimesh.voxel.VoxelGrid(cells, transform=trimesh.transformations.scale_and_translate(0.5, [10, 20, 30]))
    try:
        data = grid.export(file_type="binvox", **options)
        read = trimesh.load(io.BytesIO(data), file_type="binvox", **options)
    except ValueError as error:
        return str(error)[:45]
    return sorted(read.points.tolist()) == sorted(grid.points.tolist())

cube, oblong = np.zeros((4, 4, 4), bool), np.zeros((4, 6, 8), bool)
for cells in (cube, oblong):
    cells[0, 1, 2] = cells[3, 3, 0] = True
found = {"cube": attempt(cube), "cube, xyz": attempt(cube, axis_order="xyz"), "oblong": attempt(oblong)}
for name, result in found.items():
    print(f"{name}: {result}")
if found["cube"] is not True:
    sys.exit("changed: the cube gives %s" % found["cube"])
if "truth value" not in str(found["cube, xyz"]) or "uniform scale" not in str(found["oblong"]):
    sys.exit("changed: it is %s" % found)
PY
