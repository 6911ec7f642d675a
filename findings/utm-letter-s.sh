#!/usr/bin/env bash
# utm 0.9.0: "34S" is in the north.
#
# Expected: zone 34S, as in the names of coordinate systems (EPSG:32734, "UTM zone 34S"), is the
# southern half.
# Seen: the letter is that of a latitude band of MGRS, in which S is 32 to 40 degrees north: a place
# in Cape Town comes out in the Baltic Sea. Any band from N on is north, and the band itself is not
# checked against the result.
# So: `northern=False`, and no letter.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check utm==0.9.0
"$dir/venv/bin/python" - <<'PY'
import sys
import utm

place = (259583.222, 6245888.045, 34)
found = [
    utm.to_latlon(*place, "S"),
    utm.to_latlon(*place, "H"),
    utm.to_latlon(*place, northern=False),
]
found = [tuple(round(float(angle), 3) for angle in angles) for angles in found]
print("34 S: %s, 34 H: %s, 34 and northern=False: %s" % tuple(found))
if found[0][0] < 50 or found[1:] != [(-33.9, 18.4)] * 2:
    sys.exit("changed: %s" % found)
PY
