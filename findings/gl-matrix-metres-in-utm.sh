#!/usr/bin/env bash
# gl-matrix 3.4.4 (npm): a position in UTM is off by 10 cm after it was put into a vector, and two
# robots 20 cm apart are at one place.
#
# Expected: JavaScript's numbers are doubles, so `vec3.fromValues(462271.877, 5249737.396, 400)` is
# that, as in three's Vector3.
# Seen: vectors, quaternions and matrices are Float32Arrays: the northing becomes 5249737.5, and
# `vec3.distance` between two positions 20 cm apart is 0.
# So: `glMatrix.setMatrixArrayType(Array)` before anything else, or subtract a local origin first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts gl-matrix@3.4.4 >/dev/null
cat > place.cjs <<'JS'
const {glMatrix, vec3} = require('gl-matrix');
function place() {
  const a = vec3.fromValues(462271.877, 5249737.396, 400), b = vec3.fromValues(462271.877, 5249737.596, 400);
  return {northing: a[1], apart: +vec3.distance(a, b).toFixed(3)};
}
const plain = place();
glMatrix.setMatrixArrayType(Array);
const doubles = place();
console.log('by default:', plain, '| with Array:', doubles);
if (plain.northing !== 5249737.5 || plain.apart !== 0 || doubles.apart !== 0.2) {
  console.error('changed: it is ' + JSON.stringify([plain, doubles]));
  process.exit(1);
}
JS
node place.cjs
