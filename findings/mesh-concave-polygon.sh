#!/usr/bin/env bash
# trimesh 5.2.0 and pyvista 0.49.1 fill the notch of a concave polygon; assimp-py 1.1.0 does not.
#
# Expected: a face of five corners with a notch (a doorway in a wall, drawn as one polygon, as
# Blender writes it) has the area of its outline, 2.5.
# Seen: trimesh cuts it into a fan from its first corner: 3.5, one triangle lies outside of the
# outline and one faces the wrong way. pyvista keeps the polygon and says `area` 3.5 as well.
# assimp clips ears: 2.5. The same in PLY.
# So: triangulate before export, or after import by ear clipping; a map made from the fan has a
# wall in the doorway. Sum of areas against the outline's (half the cross products) finds such
# files.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    assimp-py==1.1.0 trimesh==5.2.0 pyvista==0.49.1 scipy==1.17.1
printf 'v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\nf 1 2 3 4 5\n' > "$dir/a.obj"
"$dir/venv/bin/python" - "$dir/a.obj" <<'PY'
import sys
import assimp_py
import numpy as np
import pyvista
import trimesh

mesh = trimesh.load(sys.argv[1], process=False)
scene = assimp_py.import_file(sys.argv[1], assimp_py.Process_Triangulate)
part = scene.meshes[0]
corners = np.array(part.vertices).reshape(-1, 3)[np.array(part.indices).reshape(-1, 3)]
clipped = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
areas = {"trimesh": float(mesh.area), "pyvista": float(pyvista.read(sys.argv[1]).area), "assimp": float(clipped)}
normals = np.cross(mesh.triangles[:, 1] - mesh.triangles[:, 0], mesh.triangles[:, 2] - mesh.triangles[:, 0])[:, 2]
print("outline: 2.5 |", areas, "| faces of trimesh that look down:", int((normals < 0).sum()))
rounded = {name: round(area, 6) for name, area in areas.items()}
if rounded != {"trimesh": 3.5, "pyvista": 3.5, "assimp": 2.5}:
    sys.exit("changed: areas are %s" % rounded)
PY
