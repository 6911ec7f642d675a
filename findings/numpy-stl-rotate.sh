#!/usr/bin/env bash
# numpy-stl 4.1.1: `rotate` by +90 degrees turns clockwise, `transform` with the same rotation turns
# counter-clockwise.
#
# Expected: an angle about an axis follows the right hand, as in trimesh, and the two methods of one
# class agree.
# Seen: `rotate([0, 0, 1], 90 degrees)` takes (1, 0, 0) to (0, -1, 0); `transform` with the matrix
# that takes x to y gives (0, 1, 0); so does trimesh with the same axis and angle. A box or a
# cylinder hides it.
# So: give `rotate` the negative angle, or use `transform`; test with a point, not with a symmetric
# part.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check numpy-stl==4.1.1 trimesh==5.2.0
"$dir/venv/bin/python" - <<'PY'
import math
import sys
import numpy as np
import trimesh
from stl import mesh

def first_corner(change):
    part = mesh.Mesh(np.zeros(1, dtype=mesh.Mesh.dtype))
    part.vectors[0] = [[1, 0, 0], [2, 0, 0], [1, 1, 0]]
    change(part)
    return (part.vectors[0][0].round(6) + 0.0).tolist()

turn = trimesh.transformations.rotation_matrix(math.pi / 2, [0, 0, 1])
rotated = first_corner(lambda part: part.rotate([0, 0, 1], math.pi / 2))
transformed = first_corner(lambda part: part.transform(turn))
other = (trimesh.transform_points([[1, 0, 0]], turn)[0].round(6) + 0.0).tolist()
print("(1, 0, 0) by rotate:", rotated, "| by transform:", transformed, "| by trimesh:", other)
if rotated != [0.0, -1.0, 0.0]:
    sys.exit("changed: rotate gives %s" % rotated)
if transformed != [0.0, 1.0, 0.0] or other != transformed:
    sys.exit("changed: transform gives %s" % transformed)
PY
