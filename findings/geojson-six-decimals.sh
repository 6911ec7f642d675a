#!/usr/bin/env bash
# geojson 3.3.0, shapely 2.2.0: positions are rounded to a decimetre.
#
# Expected: what is written has the digits that round-trip; RFC 7946 limits no digits.
# Seen: `geojson.Point`, `LineString` and all others round to 6 decimals when they are made, as does
# `shapely.to_wkt`: of degrees that is up to 5 cm on the ground. `.wkt` and `to_geojson` of shapely
# round nothing, and a track of 1 cm steps has 11 cm steps, or none.
# So: `geojson.geometry.DEFAULT_PRECISION = 15` or `precision=15`; `to_wkt(rounding_precision=-1)`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check geojson==3.3.0 shapely==2.2.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import json
import sys
import geojson
import shapely

CENTIMETRE = 9e-8  # degrees of latitude
track = [(8.0, 47.0 + CENTIMETRE * step) for step in range(10)]
latitudes = {
    "geojson": [y for _, y in geojson.LineString(track)["coordinates"]],
    "geojson, 15": [y for _, y in geojson.LineString(track, precision=15)["coordinates"]],
    "to_wkt": [y for _, y in shapely.from_wkt(shapely.to_wkt(shapely.LineString(track))).coords],
    "wkt": [y for _, y in shapely.from_wkt(shapely.LineString(track).wkt).coords],
    "to_geojson": [y for _, y in json.loads(shapely.to_geojson(shapely.LineString(track)))["coordinates"]],
}
places = {name: len(set(values)) for name, values in latitudes.items()}
print("places of 10 steps of 1 cm:", places)
if places != {"geojson": 2, "geojson, 15": 10, "to_wkt": 2, "wkt": 10, "to_geojson": 10}:
    sys.exit("changed: %s" % places)
PY
