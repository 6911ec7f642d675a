#!/usr/bin/env bash
# pywavefront 1.3.3: of two objects of one name the faces of the first are lost.
#
# Expected: `o` in OBJ starts an object; its name is a label, and exporters repeat it (a wall placed
# twice). The faces are those of the file.
# Seen: `Wavefront.meshes` is keyed by name: the second `o wall` takes the place of the first, whose
# faces are in no mesh; `mesh_list` has both, and the first of them has its faces. The vertices of
# the materials have all triangles.
# So: walk `mesh_list` instead of `meshes`, or compare the count of faces with the lines `f`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pywavefront==1.3.3
"$dir/venv/bin/python" - "$dir" <<'PY'
import logging
import sys

logging.disable(logging.CRITICAL)
import pywavefront

def faces(second):
    path = sys.argv[1] + "/a.obj"
    open(path, "w").write("o wall\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"
                          f"o {second}\nv 0 0 5\nv 1 0 5\nv 1 1 5\nf 4 5 6\n")
    scene = pywavefront.Wavefront(path, collect_faces=True, create_materials=True)
    by_name = sum(len(mesh.faces) for mesh in scene.meshes.values())
    listed = sum(len(mesh.faces) for mesh in scene.mesh_list)
    return by_name, listed, sum(len(material.vertices) // 9 for material in scene.materials.values())

found = {"wall and door": faces("door"), "wall and wall": faces("wall")}
for name, (by_name, listed, drawn) in found.items():
    print(f"{name}: {by_name} faces by name, {listed} in the list, {drawn} triangles of materials")
if found != {"wall and door": (2, 2, 2), "wall and wall": (1, 2, 2)}:
    sys.exit("changed: faces are %s" % found)
PY
