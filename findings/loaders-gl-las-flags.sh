#!/usr/bin/env bash
# @loaders.gl/las 4.4.5 on a LAS 1.2 file of laspy 2.7.0: a withheld point of class 7 has class
# 135, and bright colours turn dark.
#
# Expected: in point formats 0 to 5 the class is the low five bits of its byte, the three others
# are the flags synthetic, key-point and withheld (LAS 1.2); colours are 16 bits wide and a viewer
# shows their high byte.
# Seen: the whole byte is the class (7 + 128 = 135), so a filter on class 7, noise, keeps withheld
# noise; colours are the low byte (256, the second darkest of 256 steps, becomes 0; 32768, half,
# also 0); and coordinates are rounded to 32-bit floats in the default options: 5000000.789 is read
# as 5000001.
# So: mask with 31; ask for `las: {fp64: true, colorDepth: 16}`; write colours as multiples of 257,
# which survive both ways of reading.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check laspy==2.7.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import laspy
import numpy as np

header = laspy.LasHeader(point_format=3, version="1.2")
header.scales = np.full(3, 0.001)
header.offsets = np.array([500000.0, 5000000.0, 0.0])
las = laspy.LasData(header)
las.x, las.y, las.z = np.array([500000.123, 500001.456]), np.array([5000000.789, 5000000.012]), np.zeros(2)
las.classification, las.withheld = np.array([7, 7]), np.array([0, 1])
las.red, las.green, las.blue = np.array([65535, 32768]), np.array([256, 512]), np.array([257 * 9, 255])
las.write(sys.argv[1] + "/a.las")
again = laspy.read(sys.argv[1] + "/a.las")
print("laspy: classes", np.array(again.classification).tolist(), "withheld", np.array(again.withheld).tolist())
PY
cd "$dir"
npm install --silent --no-audit --no-fund --legacy-peer-deps @loaders.gl/core@4.4.5 @loaders.gl/las@4.4.5 >/dev/null
cat > read.mjs <<'JS'
import fs from 'node:fs';
import {parse} from '@loaders.gl/core';
import {LASLoader} from '@loaders.gl/las';
const file = fs.readFileSync('a.las');
const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.length);
const {attributes} = await parse(bytes, LASLoader, {worker: false});
const classes = Array.from(attributes.classification.value);
const colours = Array.from(attributes.COLOR_0.value);
const y = attributes.POSITION.value[1];
console.log('loaders.gl: classes', classes.join(' '), '| colours', colours.join(' '), '| y', y);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
if (classes.join() !== '7,135') changed('classes are ' + classes);
if (colours.join() !== '255,0,9,255,0,0,255,255') changed('colours are ' + colours);
if (y !== 5000001) changed('y is ' + y);
JS
node read.mjs
