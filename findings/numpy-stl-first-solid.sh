#!/usr/bin/env bash
# numpy-stl 4.1.1 reads the first solid of a text STL file and leaves the rest.
#
# Expected: a text STL may hold several `solid ... endsolid` blocks (CAD exports one per body);
# reading the file reads all, as trimesh 5.2.0, assimp, VTK and Open3D do, or says that there is
# more.
# Seen: `Mesh.from_file` returns one triangle of two. No warning; `from_multi_file` gives both.
# trimesh reads both, as a Scene of two meshes instead of a mesh.
# So: a map without its second half is no error of the file. Use from_multi_file always; with
# trimesh ask for `force="mesh"`; count `endsolid` when checking an import.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check numpy-stl==4.1.1 trimesh==5.2.0
for name in a b; do
    x=$([ $name = a ] && echo 0 || echo 5)
    printf 'solid %s\nfacet normal 0 0 1\nouter loop\nvertex %s 0 0\nvertex 9 0 0\nvertex 9 9 0\nendloop\nendfacet\nendsolid %s\n' \
        "$name" "$x" "$name"
done > "$dir/two.stl"
"$dir/venv/bin/python" - "$dir/two.stl" <<'PY'
import sys
import trimesh
from stl import mesh

one = len(mesh.Mesh.from_file(sys.argv[1]).vectors)
many = sum(len(part.vectors) for part in mesh.Mesh.from_multi_file(sys.argv[1]))
scene = trimesh.load(sys.argv[1])
print("from_file:", one, "| from_multi_file:", many, "| trimesh:", type(scene).__name__, len(scene.geometry))
if (one, many, type(scene).__name__, len(scene.geometry)) != (1, 2, "Scene", 2):
    sys.exit("changed: triangles are %s and %s" % (one, many))
PY
