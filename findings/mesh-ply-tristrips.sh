#!/usr/bin/env bash
# assimp-py 1.1.0 keeps one triangle of every strip of a PLY file.
#
# Expected: Stanford's models store `element tristrips`, one long list in which -1 ends a strip; a
# strip of six vertices is four triangles, with every second one turned.
# Seen: a strip of six vertices gives one triangle, its last. A strip of three gives its triangle
# with the first two corners exchanged, so that it faces the other way. No error, no warning.
# So: a mesh of strips comes out as a few scattered triangles; if a PLY has tristrips and the
# number of triangles is about the number of strips, it is this. plyfile 1.1.5 gives the lists, and
# cutting them oneself takes six lines.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check assimp-py==1.1.0 plyfile==1.1.5
"$dir/venv/bin/python" - "$dir/a.ply" <<'PY'
import sys
import assimp_py
from plyfile import PlyData

def triangles(strip):
    corners = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n"
    open(sys.argv[1], "w").write(
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" + corners
        + " ".join(map(str, [len(strip), *strip])) + "\n")
    scene = assimp_py.import_file(sys.argv[1], 0)
    indices = list(scene.meshes[0].indices)
    return [indices[i:i + 3] for i in range(0, len(indices), 3)]

def cut(strip):
    out, run = [], []
    for index in strip:
        run = [] if index < 0 else run + [index]
        if len(run) > 2:
            out.append(run[-3:] if len(run) % 2 else [run[-2], run[-3], run[-1]])
    return out

long, short = triangles([0, 1, 2, 3, 4, 5]), triangles([0, 1, 2])
strip = PlyData.read(sys.argv[1])["tristrips"].data[0][0].tolist()
print("strip of six: as specified", cut([0, 1, 2, 3, 4, 5]), "| assimp", long)
print("strip", strip, ": as specified", cut(strip), "| assimp", short)
if long != [[3, 4, 5]] or short != [[1, 0, 2]]:
    sys.exit("changed: strips give %s and %s" % (long, short))
PY
