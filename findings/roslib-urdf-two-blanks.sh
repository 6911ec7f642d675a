#!/usr/bin/env bash
# roslib 2.1.0 (roslibjs): a link whose origin is written with two blanks is at 0 0 0.
#
# Expected: `xyz="1  2 3"` and `xyz=" 1 2 3"` are three numbers between white space, as urdfdom
# reads them; a limit without `lower` and `upper` has 0 for both (URDF's documentation).
# Seen: the attribute is split at each single blank; one blank too many in front or between leaves
# the position at zero without a word, one at the end does not; `rpy` in the same element is used.
# Limits that are left out are NaN.
# So: normalise the white space of a robot_description before giving it to `UrdfModel`, and test
# limits with Number.isNaN.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps roslib@2.1.0 >/dev/null
cat > urdf.mjs <<'JS'
import {UrdfModel} from 'roslib';
const joint = (inner) => new UrdfModel({string: `<robot name="r"><link name="a"/><link name="b"/>
  <joint name="j" type="revolute"><parent link="a"/><child link="b"/>${inner}</joint></robot>`}).joints.j;
const place = (xyz) => {
  const {position: {x, y, z}, orientation} = joint(`<origin xyz="${xyz}" rpy="0 0 1.5707963"/>`).origin;
  return [x, y, z, orientation.z.toFixed(3)].join(' ');
};
const found = ['1 2 3', '1  2 3', ' 1 2 3', '1 2 3 '].map(place);
const {minval, maxval} = joint('<limit effort="1" velocity="1"/>');
console.log('x y z and the z of the quaternion:', found.join(' | '), '| limits:', minval, maxval);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
if (found[0] !== '1 2 3 0.707' || found[1] !== '0 0 0 0.707' || found[2] !== found[1]) changed('places are ' + found);
if (!Number.isNaN(minval) || !Number.isNaN(maxval)) changed(`limits are ${minval}, ${maxval}`);
JS
node urdf.mjs
