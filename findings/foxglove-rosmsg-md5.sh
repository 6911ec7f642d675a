#!/usr/bin/env bash
# @foxglove/rosmsg 5.0.5: the MD5 sum of a ROS 1 message with a `byte` or `char` is that of another
# message.
#
# Expected: `md5` computes what `gendeps --md5` of ROS 1 does, as its documentation says: the sum of
# the definition's text without comments, for std_msgs/Byte that of `byte data`.
# Seen: `parse` makes `int8` of `byte` and `uint8` of `char`, and the sum is taken of these: Byte
# has the sum of Int8, Char that of UInt8. ROS 1 nodes refuse a connection whose sum differs, among
# them all with diagnostic_msgs/DiagnosticStatus, which has a `byte level`.
# So: take sums from the recording or from ROS; for messages with byte and char compute them from
# the text.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps @foxglove/rosmsg@5.0.5 >/dev/null
cat > sums.js <<'JS'
const {createHash} = require('crypto');
const {md5, parse} = require('@foxglove/rosmsg');
const text = (definition) => createHash('md5').update(definition).digest('hex');
const published = {byte: 'ad736a2e8818154c487bb80fe42ce43b', char: '1bf77f25acecdedba0e224b162199717',
  int8: '27ffa0c9c4b8fb8492252bcad9e5c57b', uint8: '7c8164229e7d2c17eb95e9231617fdee'};
const found = Object.fromEntries(Object.keys(published).map((type) => [type, md5(parse(`${type} data`))]));
for (const type of Object.keys(published)) console.log(type, 'data: of the text', text(`${type} data`), '- by the package', found[type]);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
for (const [type, sum] of Object.entries(published)) if (text(`${type} data`) !== sum) changed(`the text of ${type} has another sum`);
if (found.int8 !== published.int8 || found.uint8 !== published.uint8) changed('int8 or uint8 have other sums');
if (found.byte !== published.int8 || found.char !== published.uint8) changed(`byte and char have ${found.byte}, ${found.char}`);
JS
node sums.js
