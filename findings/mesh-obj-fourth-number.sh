#!/usr/bin/env bash
# OBJ vertices with more than three numbers: four readers, three shapes (assimp-py 1.1.0, trimesh
# 5.2.0, meshio 5.3.5, pyvista 0.49.1).
#
# Expected: `v x y z w` has a weight w, which the specification uses for rational curves and
# surfaces; `v x y z r g b` is the usual extension for colours. The triangle stays where it is in
# both.
# Seen: with w = 2, assimp (and whatever loads through it, Open3D too) divides by it: a corner
# moves from x = 2 to x = 1 and the triangle loses its area. trimesh and pyvista ignore w. meshio
# makes points of 4 and of 6 coordinates from the two kinds.
# So: do not write a fourth number, and as a reader say what was done with it; take `points[:, :3]`
# after meshio.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    assimp-py==1.1.0 trimesh==5.2.0 meshio==5.3.5 pyvista==0.49.1 scipy==1.17.1
printf 'v 2 0 0 2\nv 1 0 0 1\nv 1 1 0 1\nf 1 2 3\n' > "$dir/weight.obj"
printf 'v 2 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nf 1 2 3\n' > "$dir/colour.obj"
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import assimp_py
import meshio
import numpy as np
import pyvista
import trimesh

weight, colour = sys.argv[1] + "/weight.obj", sys.argv[1] + "/colour.obj"
scene = assimp_py.import_file(weight, 0)
found = {
    "assimp": float(scene.meshes[0].vertices[0]),
    "trimesh": float(trimesh.load(weight, process=False).vertices[0][0]),
    "pyvista": float(pyvista.read(weight).points[0][0]),
}
shapes = [meshio.read(path).points.shape for path in (weight, colour)]
print("x of the vertex `2 0 0 2`:", found)
print("points by meshio:", shapes)
if found != {"assimp": 1.0, "trimesh": 2.0, "pyvista": 2.0}:
    sys.exit("changed: x is %s" % found)
if shapes != [(3, 4), (3, 6)]:
    sys.exit("changed: shapes of meshio are %s" % shapes)
PY
