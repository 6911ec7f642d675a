#!/usr/bin/env bash
# easystarjs 0.4.4: a road that costs 0.1 a tile is not taken, the same map with all costs times ten
# is driven on the road.
#
# Expected: `setTileCost` takes the multiplicative cost of a tile; multiplying every cost by ten
# leaves the cheapest path as it is.
# Seen: from the grass (cost 1) beside a road (0.1) the path stays on the grass for all 8 steps,
# cost 8, though the road costs 1.8. With 10 and 1 it goes by the road. The heuristic of its A*
# counts a whole unit per tile, so that any cost below 1 makes it an overestimate.
# So: scale the costs until the cheapest tile costs 1; costs in [0, 1], as of a normalised
# traversability, give paths that are far from the cheapest without a word.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts easystarjs@0.4.4 >/dev/null
cat > drive.cjs <<'JS'
const {js: EasyStar} = require('easystarjs');
const GRASS = 0, ROAD = 1;
function drive(grass, road) {
  const star = new EasyStar();
  star.setGrid([Array(9).fill(ROAD), Array(9).fill(GRASS), Array(9).fill(GRASS)]);
  star.setAcceptableTiles([GRASS, ROAD]);
  star.setTileCost(GRASS, grass);
  star.setTileCost(ROAD, road);
  star.enableSync();
  let rows;
  star.findPath(0, 1, 8, 1, (path) => { rows = path.map((cell) => cell.y).join(''); });
  star.calculate();
  return rows;
}
const small = drive(1, 0.1), large = drive(10, 1);
console.log('rows of the path (0 is the road), grass 1, road 0.1:', small, '| grass 10, road 1:', large);
if (small !== '111111111' || large !== '10000000001') {
  console.error('changed: the paths are ' + [small, large]);
  process.exit(1);
}
JS
node drive.cjs
