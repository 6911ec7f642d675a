#!/usr/bin/env bash
# @loaders.gl/pcd 4.4.2: red and blue change places, and a field of COUNT 3 shifts the coordinates.
#
# Expected: packed `rgb` is 0x00RRGGBB (PCL), and COUNT says how many values a field has, so that
# x, y and z come after all three values of a descriptor in front of them.
# Seen (ASCII files): 0xff8040 is read as 64, 128, 255; the same as TYPE U has a blue of 127. With
# `FIELDS f x y z`, `COUNT 3 1 1 1` and the line `4 5 6 1 2 3` the point is (5, 6, 1).
# So: put x, y and z first and fields of several values last, and check colours of a viewer built
# on it with one red point before believing them.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps @loaders.gl/core@4.4.5 @loaders.gl/pcd@4.4.2 >/dev/null
cat > read.mjs <<'JS'
import {parse} from '@loaders.gl/core';
import {PCDLoader} from '@loaders.gl/pcd';
const file = (fields, size, type, count, line) => new TextEncoder().encode(
  `VERSION 0.7\nFIELDS ${fields}\nSIZE ${size}\nTYPE ${type}\nCOUNT ${count}\nWIDTH 1\nHEIGHT 1\n` +
  `VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n${line}\n`).buffer;
const read = async (...header) => (await parse(file(...header), PCDLoader, {worker: false})).attributes;
const view = new DataView(new ArrayBuffer(4));
view.setUint32(0, 0xff8040);
const asFloat = Array.from((await read('x y z rgb', '4 4 4 4', 'F F F F', '1 1 1 1',
  `1 2 3 ${view.getFloat32(0)}`)).COLOR_0.value).slice(0, 3).join();
const asInteger = Array.from((await read('x y z rgb', '4 4 4 4', 'F F F U', '1 1 1 1',
  `1 2 3 ${0xff8040}`)).COLOR_0.value).slice(0, 3).join();
const point = Array.from((await read('f x y z', '4 4 4 4', 'F F F F', '3 1 1 1',
  '4 5 6 1 2 3')).POSITION.value).join();
console.log('255,128,64 as float:', asFloat, '| as integer:', asInteger, '| point 1,2,3 after COUNT 3:', point);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
if (asFloat !== '64,128,255') changed('colour of a float is ' + asFloat);
if (asInteger !== '64,128,127') changed('colour of an integer is ' + asInteger);
if (point !== '5,6,1') changed('the point is ' + point);
JS
node read.mjs
