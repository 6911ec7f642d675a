#!/usr/bin/env bash
# pymeshlab 2025.7: a tetrahedron that is moved by 100 m moves by 8.66 m.
#
# Expected: `compute_matrix_from_translation(axisx=100)` moves by 100, or refuses.
# Seen: the parameter has the range of the slider of MeshLab's window, five times the diagonal of
# the box around the mesh; beyond it the value is cut without a word. Small meshes move less than
# large ones. Scaling has no such range.
# So: shift the vertices in NumPy, or set the matrix itself (`set_matrix`), and compare the bounds.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pymeshlab==2025.7.post1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pymeshlab

corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

def moved(size, by):
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(corners * size, faces))
    meshes.compute_matrix_from_translation(traslmethod="XYZ translation", axisx=by)
    return round(float(meshes.current_mesh().vertex_matrix()[:, 0].min()), 2)

def scaled(by):
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(corners, faces))
    meshes.compute_matrix_from_scaling_or_normalization(axisx=by)
    return round(float(meshes.current_mesh().vertex_matrix().max()), 2)

found = {(size, by): moved(size, by) for size, by in ((1, 5.0), (1, 100.0), (1, -100.0), (10, 100.0), (100, 100.0))}
for (size, by), shift in found.items():
    print(f"edge {size} m, moved by {by} m: {shift} m")
print("scaled by 1000:", scaled(1000.0))
if list(found.values()) != [5.0, 8.66, -8.66, 86.6, 100.0]:
    sys.exit("changed: shifts are %s" % found)
if scaled(1000.0) != 1000.0:
    sys.exit("changed: scaling gives %s" % scaled(1000.0))
PY
