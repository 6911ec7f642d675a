#!/usr/bin/env bash
# pymeshlab 2025.7: a mesh that was moved without freezing is in two places, and is saved at the old
# one.
#
# Expected: with `freeze=False` the matrix of the layer is kept beside the vertices; measures,
# bounds and files either all use it or none does.
# Seen: the centroid of `get_geometric_measures` and a merged layer have moved, `bounding_box()` has
# not; PLY, OBJ, STL, OFF, 3MF and COLLADA are written without the matrix (COLLADA and 3MF have a
# place for one), so that the shift is gone in the file.
# So: `apply_matrix_freeze` before saving and before reading bounds.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pymeshlab==2025.7.post1
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
import pymeshlab

corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
left = lambda mesh: round(float(mesh.vertex_matrix()[:, 0].min()), 2)
meshes = pymeshlab.MeshSet()
meshes.add_mesh(pymeshlab.Mesh(corners, faces))
meshes.compute_matrix_from_translation(traslmethod="XYZ translation", axisx=5.0, freeze=False)
mesh = meshes.current_mesh()
found = {"bounding_box": round(float(mesh.bounding_box().min()[0]), 2),
         "barycenter": round(float(meshes.get_geometric_measures()["barycenter"][0]), 2)}
for kind in ("ply", "obj", "stl", "off", "3mf", "dae"):
    meshes.save_current_mesh(f"{sys.argv[1]}/a.{kind}")
    read = pymeshlab.MeshSet()
    read.load_new_mesh(f"{sys.argv[1]}/a.{kind}")
    found[kind] = round(left(read.current_mesh()) + float(read.current_mesh().transform_matrix()[0, 3]), 2)
meshes.generate_by_merging_visible_meshes()
found["merged"] = left(meshes.current_mesh())
for name, x in found.items():
    print(f"x by {name}: {x}")
if found["bounding_box"] != 0 or found["barycenter"] < 5 or found["merged"] != 5:
    sys.exit("changed: places are %s" % found)
if any(found[kind] != 0 for kind in ("ply", "obj", "stl", "off", "3mf", "dae")):
    sys.exit("changed: files are at %s" % found)
PY
