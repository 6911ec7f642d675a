#!/usr/bin/env bash
# simple-statistics 7.12.1 (npm): eight standard deviations have a p of 0.001, as 3.09 have; a
# permutation test says 0.
#
# Expected: `cumulativeStdNormalProbability(5)` is 0.9999997; a permutation test of random orders
# counts the observed one among them, so p is never 0; where a NaN stands does not matter.
# Seen: the function is a table of four digits up to 3.09 and 0.999 beyond, so one minus it stays at
# 0.0010. `permutationTest` of 20 runs against 20 others has p = 0. `min` is NaN if the first value
# is, and skips NaN anywhere else; the median of NaN, 2, 3 is 2, that of 2, NaN, 3 is 3.
# So: take the error function for tails (half its complement at z / sqrt(2)), add one to both counts
# of a permutation test, and drop NaN first. A report with many p of exactly 0.001 is this.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts simple-statistics@7.12.1 >/dev/null
cat > tails.cjs <<'JS'
const stats = require('simple-statistics');
const tails = [2, 3, 3.09, 5, 8].map((z) => +(1 - stats.cumulativeStdNormalProbability(z)).toFixed(7));
const runs = Array.from({length: 20}, (_, run) => run);
const permutation = stats.permutationTest(runs, runs.map((time) => time + 100));
const order = [stats.min([NaN, 1, 3]), stats.min([1, NaN, 3]), stats.median([NaN, 2, 3]), stats.median([2, NaN, 3])];
console.log('1 - P(z) for z = 2, 3, 3.09, 5, 8:', tails.join(' '));
console.log('permutation test of 20 against 20:', permutation);
console.log('min of NaN 1 3 and 1 NaN 3, median of NaN 2 3 and 2 NaN 3:', order.join(' '));
if (tails.join() !== '0.0228,0.0013,0.001,0.001,0.001') throw new Error('changed: tails are ' + tails);
if (permutation !== 0) throw new Error('changed: p is ' + permutation);
if (order.join() !== 'NaN,1,2,3') throw new Error('changed: with NaN they are ' + order);
JS
node tails.cjs
