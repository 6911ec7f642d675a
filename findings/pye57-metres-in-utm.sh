#!/usr/bin/env bash
# pye57 0.4.19: coordinates of 64 bits are written as 32 bits, without a word.
#
# Expected: `write_scan_raw` stores the float64 arrays that it takes as E57_DOUBLE, which the format
# has, or warns; what is read back, as float64, is what was written.
# Seen: the fields are E57_SINGLE whatever the arrays are. Points in UTM (easting 500 km, northing
# 4650 km) come back 0.2 m off in y, as float64; a grid of 0.1 m has gaps and doubled rows.
# So: subtract an offset from georeferenced points and give it as `translation`, which is stored in
# 64 bits; then they come back to a fraction of a millimetre.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pye57==0.4.19
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import numpy as np
import pye57

path = sys.argv[1] + "/a.e57"
steps = np.arange(20) * 0.1
points = np.column_stack([500000.0 + steps, 4649776.0 + steps, 100.0 + steps])
axes = ("cartesianX", "cartesianY", "cartesianZ")

def back(offset):
    with pye57.E57(path, mode="w") as file:
        local = points - offset
        data = {axis: local[:, at] for at, axis in enumerate(axes)}
        data["cartesianInvalidState"] = np.zeros(len(points), dtype=np.int8)
        file.write_scan_raw(data, translation=offset)
    with pye57.E57(path) as file:
        read = file.read_scan(0)
    return np.column_stack([read[axis] for axis in axes])

plain, shifted = back(np.zeros(3)), back(points[0])
error, error_shifted = np.abs(plain - points).max(axis=0), np.abs(shifted - points).max()
rows = len(np.unique(plain[:, 1]))
print("type read:", plain.dtype, "| largest errors, m:", error.round(3).tolist())
print("20 rows of y, 0.1 m apart, come back as", rows, "| with an offset, m:", f"{error_shifted:.1e}")
if error[1] < 0.1 or rows == len(points):
    sys.exit("changed: coordinates keep their decimetres")
if error_shifted > 1e-4:
    sys.exit("changed: an offset does not help")
PY
