#!/usr/bin/env bash
# meshio 5.3.5: `write("mesh.msh")` writes a file for Ansys Fluent, without data, that gmsh refuses.
#
# Expected: .msh is gmsh's extension for nearly everybody who writes it from Python; the data of
# points and cells that .vtk keeps is kept (gmsh has sections for both), or its loss is said.
# Seen: the first of three formats of that extension is taken, Ansys; heights of points and marks of
# cells are gone after reading, with no message. With `file_format="gmsh"` both are there.
# So: always name the format for .msh, and compare `cell_data` after a first round.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check meshio==5.3.5
"$dir/venv/bin/python" - "$dir" 2>/dev/null <<'PY'
import sys
import meshio
import numpy as np

corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])

def around(name, **options):
    mesh = meshio.Mesh(corners, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))], point_data={"height": np.arange(4.0)},
                       cell_data={"mark": [np.array([1.0, 2.0])]})
    path = f"{sys.argv[1]}/{name}"
    meshio.write(path, mesh, **options)
    read = meshio.read(path)
    return open(path, "rb").read(11), "height" in read.point_data, "mark" in read.cell_data

found = {".msh": around("a.msh"), ".msh, gmsh": around("b.msh", file_format="gmsh"), ".vtk": around("c.vtk")}
for name, (start, height, mark) in found.items():
    print(f"{name}: begins with {start}, heights kept: {height}, marks kept: {mark}")
if found[".msh"] != (b'(1 "meshio ', False, False):
    print("changed: .msh gives", found[".msh"])
    sys.exit(1)
if found[".msh, gmsh"] != (b"$MeshFormat", True, True) or found[".vtk"][1:] != (True, True):
    print("changed: it is", found)
    sys.exit(1)
PY
