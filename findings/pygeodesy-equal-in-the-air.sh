#!/usr/bin/env bash
# pygeodesy 26.10.26: two drones 100 m above each other are at equal places, and 0 m apart.
#
# Expected: `==` of two points with a height, LatLon(48, 11, 500) and LatLon(48, 11, 600), is False,
# as it is for their Cartesians of the same library.
# Seen: it is True, and `distanceTo` is 0.0: the height is part of what is printed and converted,
# not of what is compared. So `point in visited` and removing doubles take a tower's floors for one.
# The distance of their Cartesians is 100 m.
# So: compare `latlonheight`, or `toCartesian()`, where height matters.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pygeodesy==26.10.26
"$dir/venv/bin/python" - <<'PY'
import sys
from pygeodesy.ellipsoidalVincenty import LatLon

low, high = LatLon(48, 11, 500), LatLon(48, 11, 600)
cartesian = low.toCartesian(), high.toCartesian()
found = (low == high, low in [high], low.distanceTo(high), low.latlonheight == high.latlonheight,
         cartesian[0] == cartesian[1], round(cartesian[0].minus(cartesian[1]).length, 6))
print(low.toStr(), "and", high.toStr())
print("equal %s, in a list %s, distance %s m; latlonheight equal %s; Cartesians equal %s, distance %s m" % found)
if found != (True, True, 0.0, False, False, 100.0):
    sys.exit("changed: %s" % (found,))
PY
