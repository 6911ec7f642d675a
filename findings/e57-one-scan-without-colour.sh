#!/usr/bin/env bash
# e57 0.2.3 (PyPI): one scan without colours takes the colours of all scans; an intensity without a
# colour becomes a colour beyond 1.
#
# Expected: a survey of several stations, one of them without a camera, keeps the colours of the
# others, or has a gap for that one.
# Seen: with both scans coloured there are as many colours as points; if one has none, `color` and
# `intensity` are empty arrays, whichever comes first. Of scans with intensities alone `color` is
# that intensity three times: 500 beside the 0 .. 1 of true colours. pye57 has each scan's own.
# So: compare `len(cloud.color)` with `len(cloud.points)`, and read by scan where stations differ.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check e57==0.2.3 pye57==0.4.19
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import e57
import numpy as np
import pye57

points = {"cartesianX": np.array([1.0, 2.0]), "cartesianY": np.zeros(2), "cartesianZ": np.zeros(2)}
colours = {name: np.array([255, 0], dtype=np.uint8) for name in ("colorRed", "colorGreen", "colorBlue")}
grey = {"intensity": np.array([100.0, 500.0])}

def read(*scans):
    path = sys.argv[1] + "/a.e57"
    with pye57.E57(path, mode="w") as file:
        for scan in scans:
            file.write_scan_raw(dict(points, **scan))
    cloud = e57.read_points(path)
    largest = float(np.max(cloud.color)) if len(cloud.color) else None
    return len(cloud.points), len(cloud.color), largest

found = {"both coloured": read(colours, colours), "the second without": read(colours, {}),
         "the first without": read({}, colours), "intensities alone": read(grey, grey)}
for name, (count, coloured, largest) in found.items():
    print(f"{name}: {count} points, {coloured} colours, the largest {largest}")
if list(found.values()) != [(4, 4, 1.0), (4, 0, None), (4, 0, None), (4, 4, 500.0)]:
    sys.exit("changed: it is %s" % found)
PY
