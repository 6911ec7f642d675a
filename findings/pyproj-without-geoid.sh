#!/usr/bin/env bash
# pyproj 3.7.2: from ellipsoidal height to height above the geoid and nothing changes, also with
# `only_best=True`.
#
# Expected: from EPSG:4979 to EPSG:4326+5773 (EGM96) a point near Zurich at 500 m becomes 453 m; if
# the grid of the geoid is not at hand, as in a wheel without network, there is an error, at the
# latest with `only_best=True`, "raise if the best transformation is not available".
# Seen: 500.0 comes back as 500.0, without a warning, for EGM96 and EGM2008. `accuracy` is -1 and
# the description says "ballpark vertical transformation". Only `allow_ballpark=False` raises.
# So: pass `allow_ballpark=False` whenever heights matter, and test one known point: barometers and
# autopilots speak of the geoid, receivers of GNSS often of the ellipsoid, 47 m apart here.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyproj==3.7.2
PROJ_NETWORK=OFF "$dir/venv/bin/python" -W error - <<'PY'
import sys
from pyproj import Transformer
from pyproj.exceptions import ProjError

found = {}
for name, target in {"EGM96": "EPSG:4326+5773", "EGM2008": "EPSG:4326+3855"}.items():
    for options in ({}, {"only_best": True}, {"allow_ballpark": False}):
        try:
            transformer = Transformer.from_crs("EPSG:4979", target, always_xy=True, **options)
            answer = transformer.transform(8.5, 47.4, 500.0)[2]
        except ProjError as error:
            answer = "ProjError"
        found[name, str(options)] = answer
        print(f"500 m above the ellipsoid, {name}, {options or 'by default'}: {answer}")
if list(found.values()) != [500.0, 500.0, "ProjError"] * 2:
    sys.exit("changed: the heights are %s" % found)
PY
