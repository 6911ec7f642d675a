#!/usr/bin/env bash
# traja 25.0.1: calc_angle gives steps to the west the angle of steps to the east.
#
# Expected: its documentation says "angles between steps as a function of displacement with regard to x
# axis": atan2, as calc_heading has it.
# Seen: the angles lie between 0 and 90 degrees, whatever the direction: east and west are both 0, north
# and south 90, and all four diagonals 45. A robot that turns back has not turned by it.
# So: take calc_heading, of -180 to 180 degrees.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check traja==25.0.1 scikit-learn==1.9.1
MPLCONFIGDIR="$dir" "$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import traja

steps = {"east": (1, 0), "west": (-1, 0), "north": (0, 1), "south": (0, -1),
         "north-east": (1, 1), "north-west": (-1, 1), "south-west": (-1, -1), "south-east": (1, -1)}
angles, headings = {}, {}
for name, (x, y) in steps.items():
    track = traja.TrajaDataFrame({"x": [0.0, x, 2 * x], "y": [0.0, y, 2 * y], "time": [0, 1, 2]})
    angles[name] = round(float(traja.calc_angle(track).iloc[-1]), 6)
    headings[name] = round(float(traja.calc_heading(track).iloc[-1]), 6)
    print(f"{name}: calc_angle {angles[name]}, calc_heading {headings[name]}")
if [abs(heading) for heading in headings.values()] != [0, 180, 90, 90, 45, 135, 135, 45]:
    sys.exit(f"changed: headings are {headings}")
if list(angles.values()) != [0, 0, 90, 90, 45, 45, 45, 45]:
    sys.exit(f"changed: angles are {angles}")
PY
