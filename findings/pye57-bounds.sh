#!/usr/bin/env bash
# pye57 0.4.19: the bounds it writes are in another frame than the points, and its own default
# options refuse its own files.
#
# Expected: ASTM E2807 and libE57 give `cartesianBounds` of a scan in the local frame of its
# points, before the pose; and what a library writes it reads with its default arguments.
# Seen: points are stored locally, the bounds with the pose applied (points at x = 1 .. 3, stored
# bounds x = 10 .. 10). `read_scan(0)` raises: it wants the optional field cartesianInvalidState.
# So: never cull or size a grid by cartesianBounds without checking them against a few points, and
# read with `ignore_missing_fields=True`. A writer that adds cartesianInvalidState is read by all.
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
with pye57.E57(path, mode="w") as file:
    file.write_scan_raw(
        {"cartesianX": np.array([1.0, 2.0, 3.0]), "cartesianY": np.zeros(3), "cartesianZ": np.zeros(3)},
        rotation=np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)]),  # a quarter turn about z
        translation=np.array([10.0, 20.0, 30.0]))
with pye57.E57(path) as file:
    header = file.get_header(0)
    stored = file.read_scan_raw(0)["cartesianX"].tolist()
    bounds = [header.xMinimum, header.xMaximum]
    try:
        file.read_scan(0)
        refusal = None
    except ValueError as error:
        refusal = str(error)
print("stored x:", stored, "| bounds of x:", bounds)
print("read_scan(0):", refusal)
if stored != [1.0, 2.0, 3.0] or not np.allclose(bounds, 10.0):
    sys.exit("changed: points or bounds are in another frame")
if refusal is None or "cartesianInvalidState" not in refusal:
    sys.exit("changed: read_scan takes the file")
PY
