#!/usr/bin/env bash
# meshio 5.3.5 and trimesh 5.2.0: negative indices of OBJ faces, as several exporters write them,
# give other triangles than the file says (assimp-py 1.1.0 reads them as specified).
#
# Expected: -1 is the vertex last defined *before* the face, so that parts can be put one behind
# the other without counting (Wavefront's specification).
# Seen: two triangles at z = 0 and z = 5, each after its own vertices. trimesh resolves both from
# the end of the file: two triangles at z = 5, none at z = 0. meshio subtracts one from the
# negative number and hands out indices that mean other vertices again. Neither warns.
# So: a floor vanishes and nothing says so. A reader resolves an index when it meets it, and a test
# needs two parts: with one part every wrong rule but meshio's gives the right mesh.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check meshio==5.3.5 trimesh==5.2.0 assimp-py==1.1.0 scipy==1.17.1
cat > "$dir/a.obj" <<'OBJ'
v 0 0 0
v 1 0 0
v 1 1 0
f -3 -2 -1
v 0 0 5
v 1 0 5
v 1 1 5
f -3 -2 -1
OBJ
"$dir/venv/bin/python" - "$dir/a.obj" <<'PY'
import sys
import assimp_py
import meshio
import numpy as np
import trimesh

heights = lambda corners: [int(z) for z in np.asarray(corners)[:, :, 2].mean(axis=1)]
mesh = trimesh.load(sys.argv[1], process=False)
by_trimesh = heights(mesh.vertices[mesh.faces])
cells = np.concatenate([block.data for block in meshio.read(sys.argv[1]).cells]).tolist()
scene = assimp_py.import_file(sys.argv[1], assimp_py.Process_Triangulate)
by_assimp = []
for part in scene.meshes:
    corners = np.array(part.vertices).reshape(-1, 3)[np.array(part.indices).reshape(-1, 3)]
    by_assimp += heights(corners)
print("heights of the triangles: assimp", by_assimp, "| trimesh", by_trimesh)
print("indices by meshio:", cells)
if by_assimp != [0, 5]:
    sys.exit("changed: assimp reads heights %s" % by_assimp)
if by_trimesh != [5, 5]:
    sys.exit("changed: trimesh reads heights %s" % by_trimesh)
if cells != [[-4, -3, -2], [-4, -3, -2]]:
    sys.exit("changed: meshio reads %s" % cells)
PY
