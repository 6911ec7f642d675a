#!/usr/bin/env bash
# recast-navigation 0.43.1 (npm): a goal on another island has a path, with `success: true`, that
# ends 18 m short.
#
# Expected: `computePath` between two floors that are not connected says so: `success` is false, or
# a flag or an error names the path as partial.
# Seen: success is true, there is no error and no flag, and the path of two points ends on the edge
# of the floor where it began, beside the straight line. A goal that can be reached answers in the
# same form. Recast's own status bit for a partial result is not handed on.
# So: compare the last point with the goal, by more than the radius of the search, before driving; a
# coverage or reachability test that counts successes counts all goals.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts recast-navigation@0.43.1 >/dev/null
cat > path.mjs <<'JS'
import {init, NavMeshQuery} from 'recast-navigation';
import {generateSoloNavMesh} from 'recast-navigation/generators';
await init();
const floor = (x0, x1) => [x0, 0, 0, x1, 0, 0, x1, 0, 10, x0, 0, 10];
const {success, navMesh} = generateSoloNavMesh([...floor(0, 10), ...floor(20, 30)], [0, 2, 1, 0, 3, 2, 4, 6, 5, 4, 7, 6],
  {cs: 0.2, ch: 0.2, walkableRadius: 1});
if (!success) throw new Error('no navigation mesh');
const query = new NavMeshQuery(navMesh), start = {x: 2, y: 0, z: 5};
function drive(goal) {
  const answer = query.computePath(start, goal), end = answer.path.at(-1);
  return {success: answer.success, keys: Object.keys(answer).sort().join(), short: Math.hypot(end.x - goal.x, end.z - goal.z)};
}
const same = drive({x: 8, y: 0, z: 5}), other = drive({x: 28, y: 0, z: 5});
console.log('goal on the same floor: ', same, '\ngoal on the other floor:', other);
if (!same.success || same.short > 0.01 || !other.success || other.keys !== same.keys || !(other.short > 15)) {
  console.error('changed: the answers are ' + JSON.stringify([same, other]));
  process.exit(1);
}
JS
node path.mjs
