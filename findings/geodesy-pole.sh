#!/usr/bin/env bash
# geodesy 2.4.0 (npm): the North Pole is at 0 N, 0 E, 6378 km below the ground; navpy 1.0 has it
# 6400 km below the pole.
#
# Expected: `Cartesian.toLatLon` of a point on the axis of rotation is a pole, with the height above
# the ellipsoid, as pymap3d 3.2.0 and PROJ give it; a point 1 nm beside it hardly differs.
# Seen: (0, 0, 6356752.314) becomes latitude 0, longitude 0 and height -6378137 m, that is the
# centre of the earth, and so does every other point of the axis, without an error. One nanometre
# beside the axis the answer is 90 degrees and 0 m. navpy's `ecef2lla` gives the latitude 90 and a
# height of -6399594 m.
# So: tests at the poles and worlds of one's own whose centre is a pole need this case by hand: x =
# y = 0 means latitude +-90 degrees and height |z| - 6356752.314.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts geodesy@2.4.0 >/dev/null
cat > pole.mjs <<'JS'
import {Cartesian} from 'geodesy/latlon-ellipsoidal.js';
const found = [[0, 0, 6356752.314245], [0, 0, -6356852.314245], [1e-9, 0, 6356752.314245]].map((point) => {
  const {lat, lon, height} = new Cartesian(...point).toLatLon();
  console.log(`${point.join(', ')}: latitude ${lat}, longitude ${lon}, height ${Math.round(height)}`);
  return [lat, Math.abs(Math.round(height))].join(' ');
});
if (found.join() !== '0 6378137,0 6378137,90 0') {
  console.error('changed: ' + found);
  process.exit(1);
}
JS
node pole.mjs
python3 -m venv venv
venv/bin/pip install -q --no-compile --disable-pip-version-check pymap3d==3.2.0 navpy==1.0
venv/bin/python -c '
import navpy
import pymap3d
latitude, _, height = pymap3d.ecef2geodetic(0, 0, 6356752.314245)
print("pymap3d: latitude", latitude, "height", round(height, 3))
assert latitude == 90 and abs(height) < 0.001, "changed: pymap3d is not at the pole"
latitude, _, height = navpy.ecef2lla([0, 0, 6356752.314245])
print("navpy: latitude", latitude, "height", round(height))
assert latitude == 90 and round(height) == -6399594, "changed: navpy has the pole elsewhere"'
