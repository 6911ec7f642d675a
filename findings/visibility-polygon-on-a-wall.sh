#!/usr/bin/env bash
# visibility-polygon 1.1.0 (npm): a camera on the wall of a room of 100 square metres sees 112, one
# in a corner 123, 105.5 or NaN.
#
# Expected: what is seen from a place in a closed room is at most the room; walls on all sides
# surround the observer, and only for one who is not surrounded the documentation announces a box
# around everything.
# Seen: for an observer on a wall the polygon goes out through that wall, to a box 1 m outside of
# the room. In one of the four corners a vertex has no coordinates. A micrometre inside it is 100.
# So: move cameras and viewpoints that touch a wall inwards by more than the tolerance (1e-7), or
# cut the polygon with the room, before areas are added up (art gallery, coverage).
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps visibility-polygon@1.1.0 >/dev/null
cat > camera.mjs <<'JS'
import * as module from 'visibility-polygon';
const {compute, convertToSegments} = module.compute ? module : module.default;
const room = convertToSegments([[[0, 0], [10, 0], [10, 10], [0, 10]]]);
const area = (polygon) => Math.abs(polygon.reduce((sum, [x, y], i) => {
  const [u, v] = polygon[(i + 1) % polygon.length];
  return sum + x * v - u * y;
}, 0)) / 2;
const seen = (place) => Number(area(compute(place, room)).toFixed(2));
const walls = [[0, 5], [5, 0], [10, 5], [5, 10]].map(seen);
const corners = [[0, 0], [10, 0], [0, 10], [10, 10]].map(seen);
const inside = [[5, 5], [1e-6, 5], [1e-6, 1e-6]].map(seen);
console.log('on the walls:', walls.join(), '| in the corners:', corners.join(), '| inside:', inside.join());
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
if (walls.join() !== '112,112,112,112' || corners.join() !== '123,105.5,123,NaN') changed(`walls ${walls}, corners ${corners}`);
if (inside.join() !== '100,100,100') changed('inside is ' + inside);
JS
node camera.mjs
