#!/usr/bin/env bash
# urdf-loader 0.13.1 (npm): the three angles of a floating joint are another rotation than the same
# three as `rpy` of an origin.
#
# Expected: its source calls the six values of a floating joint X, Y, Z, R, P, Y; roll, pitch and
# yaw have one order in URDF (about fixed axes: x, then y, then z).
# Seen: the origin turns in that order, `setJointValue` in the reverse one: with 0.1, 0.2 and 0.3
# the two rotations are 4 degrees apart, with a quarter turn in each 180. With one angle alone they
# agree, so that a first test passes.
# So: set the link's quaternion of the viewer from the pose, not the angles of the joint.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund urdf-loader@0.13.1 three@0.187.0 jsdom@29.1.1 >/dev/null
cat > read.mjs <<'JS'
import {JSDOM} from 'jsdom';
const {window} = new JSDOM('');
Object.assign(globalThis, {window, document: window.document, DOMParser: window.DOMParser, Element: window.Element, Document: window.Document});
const {default: URDFLoader} = await import('urdf-loader');
function load(joint) {
  return new URDFLoader().parse(`<robot name="r"><link name="a"/><link name="b"/>${joint}</robot>`);
}
function columns(robot) {
  robot.updateMatrixWorld(true);
  return robot.links.b.matrixWorld.elements.slice(0, 11);
}
function degrees(angles) {
  const ends = '<parent link="a"/><child link="b"/>';
  const fixed = columns(load(`<joint name="j" type="fixed"><origin rpy="${angles.join(' ')}"/>${ends}</joint>`));
  const floating = load(`<joint name="j" type="floating">${ends}</joint>`);
  floating.setJointValue('j', 0, 0, 0, ...angles);
  const other = columns(floating);
  const trace = fixed.reduce((sum, value, index) => sum + value * other[index], 0);
  return Number((Math.acos(Math.min(1, (trace - 1) / 2)) * 180 / Math.PI).toFixed(1));
}
const found = {'yaw alone': degrees([0, 0, 0.3]), 'three small angles': degrees([0.1, 0.2, 0.3]),
  'three quarter turns': degrees([Math.PI / 2, Math.PI / 2, Math.PI / 2])};
console.log('degrees between origin and floating joint:', found);
if (found['yaw alone'] > 0.1 || Math.abs(found['three small angles'] - 4) > 0.3 || found['three quarter turns'] < 179) {
  console.error('changed: degrees are ' + JSON.stringify(found));
  process.exit(1);
}
JS
node read.mjs
