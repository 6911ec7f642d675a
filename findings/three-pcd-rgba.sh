#!/usr/bin/env bash
# PCDLoader of three 0.187.0: a cloud with the field `rgba` is without colours, and VIEWPOINT moves
# nothing.
#
# Expected: `rgb` and `rgba` are PCL's two names of one packed field (PointXYZRGB and PointXYZRGBA);
# VIEWPOINT is the pose of the sensor in which the points stand.
# Seen: of the same number `rgb` makes red and `rgba` no attribute at all; a cloud whose viewpoint
# is at (10, 20, 30) lies at the origin, with nothing left of the pose, so that stations of one
# survey are drawn on each other.
# So: rename the field when writing for the web, and transform the points first.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund three@0.187.0 >/dev/null
cat > read.mjs <<'JS'
import {PCDLoader} from 'three/examples/jsm/loaders/PCDLoader.js';
function read(field, viewpoint) {
  const text = ['# .PCD v0.7', 'VERSION 0.7', `FIELDS x y z ${field}`, 'SIZE 4 4 4 4', 'TYPE F F F U', 'COUNT 1 1 1 1', 'WIDTH 1',
    'HEIGHT 1', `VIEWPOINT ${viewpoint}`, 'POINTS 1', 'DATA ascii', '1 2 3 4294901760', ''].join('\n');
  const points = new PCDLoader().parse(new TextEncoder().encode(text).buffer);
  points.updateMatrixWorld(true);
  const colour = points.geometry.getAttribute('color');
  const place = points.localToWorld(points.position.clone().fromBufferAttribute(points.geometry.getAttribute('position'), 0));
  return {colour: colour ? Array.from(colour.array) : null, place: place.toArray(), user: Object.keys(points.userData).length};
}
const rgb = read('rgb', '0 0 0 1 0 0 0'), rgba = read('rgba', '0 0 0 1 0 0 0'), moved = read('rgb', '10 20 30 1 0 0 0');
console.log('rgb:', rgb.colour, '| rgba:', rgba.colour, '| from a sensor at (10, 20, 30):', moved.place, 'user data:', moved.user);
if (String(rgb.colour) !== '1,0,0' || rgba.colour !== null || String(moved.place) !== '1,2,3' || moved.user !== 0) {
  console.error('changed: it is ' + JSON.stringify([rgb, rgba, moved]));
  process.exit(1);
}
JS
node read.mjs
