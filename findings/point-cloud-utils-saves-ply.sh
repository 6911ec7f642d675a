#!/usr/bin/env bash
# point-cloud-utils 0.34.0: a mesh of vertices and faces is saved as PLY, and as nothing else.
#
# Expected: `save_mesh_vf` takes the extension of any format that it lists (OBJ, OFF, STL, PLY), and
# keeps coordinates in double precision as it was given them.
# Seen: OBJ, OFF and STL raise "Invalid dtype for argument 'v_colors'", though no colours were
# given; in the PLY coordinates are of single precision: 4 cm are lost in UTM, without a word.
# So: subtract an offset first and write PLY, or write with another library.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check point-cloud-utils==0.34.0 numpy==2.4.6
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
import point_cloud_utils as pcu

corners = np.array([[500000.123, 5400000.456, 0], [500001.123, 5400000.456, 0], [500001.123, 5400001.456, 0]])
faces = np.array([[0, 1, 2]])
found = {}
for kind in np.float64, np.float32:
    for extension in ("ply", "obj", "off", "stl"):
        path = f"{sys.argv[1]}/a.{extension}"
        try:
            pcu.save_mesh_vf(path, corners.astype(kind), faces)
            found[kind.__name__, extension] = round(float(np.abs(pcu.load_mesh_v(path, dtype=np.float64) - corners).max()), 3)
        except ValueError as error:
            found[kind.__name__, extension] = str(error)[:40]
        print(kind.__name__, extension, found[kind.__name__, extension])
if found["float64", "ply"] != 0.044:
    sys.exit("changed: the PLY is off by %s" % found["float64", "ply"])
if any("v_colors" not in str(found["float64", extension]) for extension in ("obj", "off", "stl")):
    sys.exit("changed: it is %s" % found)
PY
