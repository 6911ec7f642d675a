#!/usr/bin/env bash
# XYZLoader of three 0.187.0: a scan with intensities, or separated by commas, is an empty cloud;
# normals become colours.
#
# Expected: a text file of points has x, y and z first, whatever columns come after; what cannot be
# read is an error.
# Seen: a line is read if it has 3 columns, or 6, of which the last three are colours; any other
# number, so `x y z intensity` and `x y z i r g b`, is skipped without a word, and the geometry has
# no points. `x y z nx ny nz`, the .xyz of most programs for surfaces, has its normals divided by
# 255 as its colours: it is black. If lines of both kinds are mixed, colours are fewer than points.
# So: cut the file to three columns, or write PLY; check `position.count` after loading.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts three@0.187.0 >/dev/null
cat > read.mjs <<'JS'
import {XYZLoader} from 'three/examples/jsm/loaders/XYZLoader.js';
function read(line) {
  const {position, color} = new XYZLoader().parse(`${line}\n${line}\n`).attributes;
  return {points: position ? position.count : 0, colour: color ? Array.from(color.array.slice(0, 3), (v) => +v.toFixed(4)).join() : null};
}
const lines = {'x y z': '1 2 3', 'x y z intensity': '1 2 3 0.5', 'x y z i r g b': '1 2 3 0.5 255 0 0', 'x,y,z': '1,2,3', 'x y z nx ny nz': '1 2 3 0 0 1'};
const found = Object.fromEntries(Object.entries(lines).map(([name, line]) => [name, read(line)]));
console.log(found);
const counts = Object.values(found).map((cloud) => cloud.points).join();
if (counts !== '2,0,0,0,2' || !/^0,0,0\.00\d+$/.test(found['x y z nx ny nz'].colour)) {
  console.error('changed: the clouds are ' + JSON.stringify(found));
  process.exit(1);
}
JS
node read.mjs
