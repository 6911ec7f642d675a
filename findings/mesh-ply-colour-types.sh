#!/usr/bin/env bash
# PLY colours that are not bytes: Open3D 0.20.0, trimesh 5.2.0 and assimp-py 1.1.0 read three
# different pictures.
#
# Expected: a property's type is part of its meaning: `float red` is 0 to 1, `ushort red` 0 to
# 65535, `uchar red` 0 to 255 (assimp reads it so).
# Seen: Open3D divides whatever it finds by 255: a float of 1.0 becomes 0.004, nearly black, and a
# ushort of 65535 becomes 257.0. trimesh reads floats well, and of a ushort the low byte: 32768,
# half bright, becomes 0.
# So: write uchar. As a reader of point clouds coloured by others, look at the declared type, and
# suspect colours that are all below 0.004 or above 1.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0 trimesh==5.2.0 assimp-py==1.1.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import assimp_py
import numpy as np
import open3d
import trimesh

def read(kind, values):
    path = f"{sys.argv[1]}/{kind}.ply"
    open(path, "w").write(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
        + "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
        + f"end_header\n0 0 0 {values}\n")
    scene = assimp_py.import_file(path, 0)
    return {
        "assimp": [round(float(c), 3) for c in scene.meshes[0].colors[0]][:3],
        "open3d": np.asarray(open3d.io.read_point_cloud(path).colors)[0].round(3).tolist(),
        "trimesh": (np.array(trimesh.load(path).colors)[0, :3] / 255).round(3).tolist(),
    }

floats, shorts = read("float", "1.0 0.5 0.25"), read("ushort", "65535 32768 256")
print("float 1.0 0.5 0.25:", floats)
print("ushort 65535 32768 256:", shorts)
if floats != {"assimp": [1.0, 0.5, 0.25], "open3d": [0.004, 0.002, 0.001], "trimesh": [1.0, 0.502, 0.251]}:
    sys.exit("changed: floats are %s" % floats)
if shorts != {"assimp": [1.0, 0.5, 0.004], "open3d": [257.0, 128.502, 1.004], "trimesh": [1.0, 0.0, 0.0]}:
    sys.exit("changed: shorts are %s" % shorts)
PY
