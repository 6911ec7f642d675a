#!/usr/bin/env bash
# Open3D 0.20.0 does not read the .glb that it writes; trimesh 5.2.0 does.
#
# Expected: write_triangle_mesh, then read_triangle_mesh, gives the mesh back; in a .glb the
# geometry is the second, binary chunk (glTF 2.0, "GLB file format").
# Seen: Open3D's .glb has one chunk, JSON, with the geometry as a base64 text in `buffers[0].uri`.
# Its own reader takes the missing binary chunk for the buffer: "Buffer view with offset/length is
# out of range", and an empty mesh; the return value is no error. The .gltf of the same mesh is
# read.
# So: use .gltf or .ply between Open3D programs; a reader of .glb has to decode data URIs also
# there, and `generator: "Open3D"` without a BIN chunk is this writer.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check open3d==0.20.0 trimesh==5.2.0 scipy==1.17.1
"$dir/venv/bin/python" - "$dir" <<'PY'
import json
import struct
import sys
import open3d
import trimesh

box = open3d.geometry.TriangleMesh.create_box(1, 2, 3)
faces = {}
for kind in ("glb", "gltf"):
    path = f"{sys.argv[1]}/a.{kind}"
    written = open3d.io.write_triangle_mesh(path, box)
    faces[kind] = (written, len(open3d.io.read_triangle_mesh(path).triangles), len(trimesh.load(path, force="mesh").faces))
data = open(sys.argv[1] + "/a.glb", "rb").read()
length = struct.unpack("<I", data[12:16])[0]
uri = json.loads(data[20:20 + length])["buffers"][0].get("uri", "")[:37]
print("glb:  written %s, triangles by Open3D %d, by trimesh %d" % faces["glb"])
print("gltf: written %s, triangles by Open3D %d, by trimesh %d" % faces["gltf"])
print("bytes behind the JSON chunk:", len(data) - 20 - length, "| buffer:", uri)
if faces != {"glb": (True, 0, 12), "gltf": (True, 12, 12)}:
    sys.exit("changed: triangles are %s" % faces)
if len(data) != 20 + length or not uri.startswith("data:"):
    sys.exit("changed: the buffer is %s" % uri)
PY
