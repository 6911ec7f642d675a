#!/usr/bin/env bash
# Open3D 0.20.0: text files of its writers have six digits: 5000000.654 is written as 5e+06.
#
# Expected: a file that declares `property double x` holds doubles, as the binary form of the same
# file does.
# Seen: PLY written as text, OBJ and OFF round to six digits: a point of a survey (UTM, metres)
# moves by up to 5 m, and the cloud becomes a comb of lines a metre apart. XYZ (ten decimals), PCD
# (ten digits) and binary PLY are fine.
# So: never `write_ascii=True` for coordinates of a survey; OBJ needs an offset subtracted first. A
# PLY text file whose numbers have an exponent and few digits was written by it and cannot be
# mended.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
import open3d

point = [500000.123456, 5000000.654321, 1.5]
cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector([point, [500001, 5000001, 2]]))
found = {}
for name, text in (("a.ply", True), ("b.ply", False), ("a.pcd", True), ("a.xyz", True)):
    path = f"{sys.argv[1]}/{name}"
    open3d.io.write_point_cloud(path, cloud, write_ascii=text)
    found[name] = np.asarray(open3d.io.read_point_cloud(path).points)[0]
mesh = open3d.geometry.TriangleMesh(
    open3d.utility.Vector3dVector([point, [500001, 5000000, 0], [500000, 5000002, 0]]), open3d.utility.Vector3iVector([[0, 1, 2]]))
for name in ("a.obj", "a.off"):
    open3d.io.write_triangle_mesh(f"{sys.argv[1]}/{name}", mesh)
    found[name] = np.asarray(open3d.io.read_triangle_mesh(f"{sys.argv[1]}/{name}").vertices)[0]
print("types:", [line for line in open(sys.argv[1] + "/a.ply").read().splitlines() if line.endswith(" x")])
errors = {name: round(float(np.abs(read - point).max()), 3) for name, read in found.items()}
for name, error in errors.items():
    print(f"{name}{' (text)' if name == 'a.ply' else ''}: off by {error} m")
if {name: errors[name] for name in ("a.ply", "a.obj", "a.off")} != dict.fromkeys(("a.ply", "a.obj", "a.off"), 0.654):
    sys.exit("changed: errors are %s" % errors)
if max(errors[name] for name in ("b.ply", "a.pcd", "a.xyz")) > 0.001:
    sys.exit("changed: errors are %s" % errors)
PY
