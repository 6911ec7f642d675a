#!/usr/bin/env bash
# A binary PLY with one quad and one triangle: pyntcloud 0.3.1 invents indices, trimesh 5.2.0
# refuses the file; and meshio 5.3.5 turns points into numbers if z stands first.
#
# Expected: a list property has its own length in every row (Blender writes quads and triangles
# side by side), and a property is found by its name, in any order.
# Seen: pyntcloud takes every row to be as long as three corners: the second face has an index of
# 50331648. trimesh: "PLY is unexpected length!". meshio reads the faces well, but of `z y x` it
# takes the one column in place, silently: points of one coordinate, 0, 0, 5.
# So: write triangles only, x, y and z first and in this order; test a reader with a quad before a
# triangle (the other order hides the fault in the last row).
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    pyntcloud==0.3.1 trimesh==5.2.0 meshio==5.3.5 plyfile==1.1.5
"$dir/venv/bin/python" - "$dir" <<'PY'
import struct
import sys
import meshio
import trimesh
from plyfile import PlyData
from pyntcloud import PyntCloud

path, order = sys.argv[1] + "/mixed.ply", sys.argv[1] + "/order.ply"
header = ("ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
          "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n")
with open(path, "wb") as file:
    file.write(header.encode())
    for point in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)):
        file.write(struct.pack("<fff", *point))
    file.write(struct.pack("<Biiii", 4, 0, 1, 2, 3) + struct.pack("<Biii", 3, 0, 1, 2))
true = [row[0].tolist() for row in PlyData.read(path)["face"].data]
invented = PyntCloud.from_file(path).mesh.values.tolist()
try:
    trimesh.load(path)
    refusal = None
except ValueError as error:
    refusal = str(error)
open(order, "w").write(
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float z\nproperty float y\nproperty float x\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n9 0 1\n9 0 2\n9 5 1\n3 0 1 2\n")
points = meshio.read(order).points.tolist()
print("faces by plyfile:", true, "| by pyntcloud:", invented)
print("trimesh:", refusal)
print("points by meshio of z y x:", points)
if invented != [[0, 1, 2], [50331648, 0, 1]]:
    sys.exit("changed: pyntcloud reads %s" % invented)
if refusal is None or "unexpected length" not in refusal:
    sys.exit("changed: trimesh says %s" % refusal)
if points != [[0.0], [0.0], [5.0]]:
    sys.exit("changed: meshio reads %s" % points)
PY
