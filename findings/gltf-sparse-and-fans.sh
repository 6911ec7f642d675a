#!/usr/bin/env bash
# trimesh 5.2.0 reads a glTF file without its corrections and its fans (assimp-py 1.1.0 reads
# both).
#
# Expected: sparse accessors and the primitive mode TRIANGLE_FAN belong to the core of glTF 2.0,
# not to extensions; a reader has them or refuses.
# Seen: a sparse accessor (some values replaced, how optimisers and editors store few changes) is
# read as its base: a roof at y = 9 stays at y = 1; without a base all vertices are at the origin.
# A fan is dropped and the scene is empty. No error.
# So: compare the bounds with `min` and `max` of the POSITION accessor, which every glTF file must
# have: both losses show at once.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trimesh==5.2.0 assimp-py==1.1.0 scipy==1.17.1
"$dir/venv/bin/python" - "$dir" <<'PY'
import base64
import json
import struct
import sys
import assimp_py
import trimesh

def read(name, data, accessor, views, mode):
    path = f"{sys.argv[1]}/{name}.gltf"
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    json.dump({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}],
        "accessors": [accessor], "bufferViews": views, "buffers": [{"byteLength": len(data), "uri": uri}],
    }, open(path, "w"))
    scene = trimesh.load(path)
    top = None if scene.is_empty else float(scene.bounds[1][1])
    other = assimp_py.import_file(path, assimp_py.Process_PreTransformVertices)
    part = other.meshes[0]
    return top, max(list(part.vertices)[1::3]), len(part.indices) // 3

points = b"".join(struct.pack("<fff", *p) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 2, 0)))
sparse = read(
    "sparse", points[:36] + struct.pack("<HH", 2, 0) + struct.pack("<fff", 0, 9, 0),
    {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 9, 0],
     "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 2}}},
    [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 2},
     {"buffer": 0, "byteOffset": 40, "byteLength": 12}], 4)
fan = read(
    "fan", points, {"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3", "min": [0, 0, 0],
                    "max": [1, 2, 0]}, [{"buffer": 0, "byteLength": 60}], 6)
print("highest y of the sparse accessor: file 9 | trimesh", sparse[0], "| assimp", sparse[1])
print("fan of three triangles: trimesh", fan[0], "| assimp", fan[2], "triangles")
if sparse != (1.0, 9.0, 1):
    sys.exit("changed: the sparse accessor gives %s" % (sparse,))
if fan[0] is not None or fan[2] != 3:
    sys.exit("changed: the fan gives %s" % (fan,))
PY
