#!/usr/bin/env bash
# yuka 0.7.8 (npm): the path of a navigation mesh to a goal that is not on it leaves the floor, in a
# straight line, through whatever is there.
#
# Expected: `NavMesh.findPath` to a point outside of all regions is empty, or ends at the last point
# of the floor before it.
# Seen: a region is chosen for the goal by the distance of its centre, and the goal itself is put
# behind the path: with a floor of two rooms the path ends 7 m outside of the wall. It looks as the
# path to any other goal; a goal on another island, though, gives the empty path. The start is
# treated alike. Rays are as trusting: `intersectBoundingSphere` with a direction of length 2 hits
# the sphere of radius 1 at 2.4.
# So: ask `getRegionForPoint(goal, epsilon)` first, and clamp.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts yuka@0.7.8 >/dev/null
cat > path.mjs <<'JS'
import {BoundingSphere, NavMesh, Polygon, Ray, Vector3} from 'yuka';
const room = (x) => new Polygon().fromContour([[x, 0], [x, 2], [x + 2, 2], [x + 2, 0]].map(([a, b]) => new Vector3(a, 0, b)));
const mesh = new NavMesh().fromPolygons([room(0), room(2), room(20)]);
const path = (from, to) => mesh.findPath(new Vector3(from[0], 0, from[1]), new Vector3(to[0], 0, to[1])).map(({x, z}) => [x, z]);
const found = {
  'on the floor': path([0.5, 1], [3.5, 1]),
  'outside': path([0.5, 1], [3.5, 9]),
  'from outside': path([0.5, -9], [3.5, 1]),
  'another island': path([0.5, 1], [21, 1]),
};
for (const [name, points] of Object.entries(found)) console.log(`${name}: ${JSON.stringify(points)}`);
console.log('region of the goal outside:', mesh.getRegionForPoint(new Vector3(3.5, 0, 9), 0.01));
const sphere = new BoundingSphere(new Vector3(0, 0, 0), 1);
const hits = [1, 2].map((length) =>
  new Ray(new Vector3(-5, 0, 0), new Vector3(length, 0, 0)).intersectBoundingSphere(sphere, new Vector3()).x);
console.log(`x of the hit with a direction of length 1: ${hits[0]}, of length 2: ${hits[1].toFixed(2)}`);
const ends = Object.values(found).map((points) => [points[0], points[points.length - 1]]);
if (JSON.stringify(ends) !== '[[[0.5,1],[3.5,1]],[[0.5,1],[3.5,9]],[[0.5,-9],[3.5,1]],[null,null]]') {
  throw new Error('changed: ends are ' + JSON.stringify(ends));
}
if (hits[0] !== -1 || Math.abs(hits[1] + 1) < 0.1) throw new Error('changed: hits are ' + hits);
JS
node path.mjs
