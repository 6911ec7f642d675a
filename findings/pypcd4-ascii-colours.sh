#!/usr/bin/env bash
# pypcd4 1.5.1: saving a coloured cloud as ASCII makes every point black.
#
# Expected: the three encodings of a PCD file hold the same values; PCL writes the packed `rgb`
# float with enough digits to read it back.
# Seen: ASCII values are written with ten fixed decimals. A packed colour is a float of about 1e-38
# and a small double (3e-12) is below that too, so both become 0.0000000000. No warning.
# So: ask for binary or binary_compressed for colours; a reader cannot tell such a file from a
# black cloud, but `rgb` of TYPE F that is 0 at every point of an ASCII file deserves a warning.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pypcd4==1.5.1
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
from pypcd4 import Encoding, PointCloud

colours = np.array([[255, 0, 1], [10, 20, 30]], np.uint8)
cloud = PointCloud.from_xyzrgb_points(
    np.c_[np.zeros((2, 3), np.float32), PointCloud.encode_rgb(colours)])
read = {}
for encoding in (Encoding.BINARY, Encoding.BINARY_COMPRESSED, Encoding.ASCII):
    path = f"{sys.argv[1]}/{encoding.value}.pcd"
    cloud.save(path, encoding=encoding)
    read[encoding.value] = PointCloud.decode_rgb(PointCloud.from_path(path).pc_data["rgb"]).tolist()
    print(f"{encoding.value}: {read[encoding.value]}")
print("last line of the ASCII file:", open(f"{sys.argv[1]}/ascii.pcd").read().splitlines()[-1])
kept = colours.tolist()
if read["binary"] != kept or read["binary_compressed"] != kept:
    sys.exit("changed: a binary encoding does not keep the colours")
if read["ascii"] != [[0, 0, 0], [0, 0, 0]]:
    sys.exit("changed: the ASCII encoding keeps colours")
PY
