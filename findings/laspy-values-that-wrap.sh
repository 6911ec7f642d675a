#!/usr/bin/env bash
# laspy 2.7.0: a value too large is an error in some fields and another value in others.
#
# Expected: what does not fit is refused, as for coordinates and classes (OverflowError).
# Seen: intensity, colours, point_source_id and user_data take numbers modulo their width: an
# intensity of 70000 is stored as 4464, a user_data of 300 as 44. No warning.
# So: clip before assigning (bright targets of a sensor with 20 bits become dark ones otherwise);
# an intensity image with dark spots in retro-reflectors was made like that.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - <<'PY'
import sys
import laspy
import numpy as np

las = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
las.x = las.y = las.z = np.zeros(1)
found = {}
for field, value in (("x", 3e8), ("classification", 40), ("intensity", 70000), ("red", 70000),
                     ("point_source_id", 70000), ("user_data", 300)):
    try:
        setattr(las, field, np.array([value]))
        found[field] = int(np.array(las[field])[0])
    except OverflowError:
        found[field] = "refused"
    print(f"{field} = {value:g}: {found[field]}")
if found != {"x": "refused", "classification": "refused", "intensity": 4464, "red": 4464, "point_source_id": 4464, "user_data": 44}:
    sys.exit("changed: values are %s" % found)
PY
