#!/usr/bin/env bash
# rbush-3d 0.1.2: a ray along the joint between two boxes goes through a closed wall.
#
# Expected: `raycast` finds the nearest box that the ray meets; `search` of the same tree counts
# boxes that touch, so a ray in the plane where two boxes touch meets both.
# Seen: a wall of 16 cells is hit at distance 5 from y = 1.5, and from y = 2 not at all (`dist` is
# Infinity), nor along the floor that the wall stands on. A ray that is inclined by 1e-12 hits. The
# distance is in lengths of the direction: (2, 0, 0) meets the wall at 2.5.
# So: with boxes on a lattice keep sensors off multiples of the cell, or incline axis-parallel rays
# a little; normalise directions.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps rbush-3d@0.1.2 >/dev/null
cat > rays.js <<'JS'
const {RBush3D} = require('rbush-3d');
const tree = new RBush3D();
const cells = Array.from({length: 16}, (_, i) => ({minX: 5, maxX: 6, minY: i % 4, maxY: (i % 4) + 1,
  minZ: Math.floor(i / 4), maxZ: Math.floor(i / 4) + 1}));
tree.load(cells);
const touched = (y, z) => tree.search({minX: 0, maxX: 9, minY: y, maxY: y, minZ: z, maxZ: z}).length;
const found = [[1.5, 1.5], [2, 1.5], [1.5, 2], [1.5, 0]].map(([y, z]) => [tree.raycast(0, y, z, 1, 0, 0).dist,
  tree.raycast(0, y, z, 1, 1e-12, 1e-12).dist, touched(y, z)].join(' '));
const longer = tree.raycast(0, 1.5, 1.5, 2, 0, 0).dist;
console.log('distance, distance if inclined, boxes on the line:', found.join(' | '), '| direction (2, 0, 0):', longer);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
if (found.join() !== '5 5 1,Infinity 5 2,Infinity 5 2,Infinity 5 1') changed('rays give ' + found);
if (longer !== 2.5) changed('the longer direction gives ' + longer);
JS
node rays.js
