#!/usr/bin/env bash
# kd-tree-javascript 1.0.3: of 100 points on a grid 32 cannot be removed, and the nearest neighbour
# comes last.
#
# Expected: `remove(point)` takes a point out by reference, as its documentation says;
# `nearest(point, 4)` lists the nearest first, as k-d trees do elsewhere.
# Seen: points with an equal coordinate may lie on either side of their parent, `remove` looks on
# one side only: it leaves 32 of 100 grid points where they were, without an error, and the search
# still finds them; after a removal of all 100, 31 are left. 100 points without equal
# coordinates are all removed. The four neighbours of (4.1, 4.2) begin with the farthest.
# So: rebuild the tree instead of removing viewpoints or cells of a grid; sort what `nearest`
# returns by the second entry.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund kd-tree-javascript@1.0.3 >/dev/null
cat > tree.js <<'JS'
const {kdTree} = require('kd-tree-javascript');
const square = (a, b) => (a.x - b.x) ** 2 + (a.y - b.y) ** 2;
const build = (points) => new kdTree(points.slice(), square, ['x', 'y']);
const count = (tree) => (tree.root ? tree.nearest({x: 0, y: 0}, 1000).length : 0);
const removeAll = (points) => {
  const tree = build(points);
  points.forEach((point) => tree.remove(point));
  return count(tree);
};
const grid = Array.from({length: 100}, (_, i) => ({x: Math.floor(i / 10), y: i % 10}));
const scattered = Array.from({length: 100}, (_, i) => ({x: (i * 37) % 101, y: (i * 53) % 101}));
const stuck = grid.filter((point) => {
  const tree = build(grid);
  tree.remove(point);
  return count(tree) === 100;
}).length;
const left = [grid, scattered].map(removeAll);
const distances = build(grid).nearest({x: 4.1, y: 4.2}, 4).map(([, distance]) => distance.toFixed(2)).join();
console.log('cannot be removed:', stuck, 'of 100 | left after removing all: grid', left[0], 'scattered', left[1]);
console.log('squared distances of the four nearest:', distances);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
if (stuck !== 32 || left.join() !== '31,0') changed(`${stuck} are stuck, left are ${left}`);
if (distances !== '1.25,0.85,0.65,0.05') changed('the distances are ' + distances);
JS
node tree.js
