#!/usr/bin/env bash
# quaternion 2.2.0 (npm, Quaternion.js): `RPY` with roll, pitch and yaw is not the rotation of URDF
# and ROS.
#
# Expected: `Quaternion.fromEuler(roll, pitch, yaw, 'RPY')` is the rotation of `rpy="roll pitch
# yaw"` in URDF, about fixed axes x, then y, then z (REP 103): Rz(yaw) Ry(pitch) Rx(roll).
# Seen: it is Rx(roll) Ry(pitch) Rz(yaw): the documentation has RPY as another name of XYZ,
# multiplied from left to right. One axis alone is right, so tests with yaw only pass; for (0.1,
# 0.2, 0.3) the two are 4 degrees apart, for (0.5, 0.5, 0.5) 23.8. `fromEuler(yaw, pitch, roll,
# 'YPR')` and `fromEulerLogical(roll, pitch, yaw, 'RPY')` are URDF's.
# So: use `fromEulerLogical` for ROS, and test with two angles that are not zero.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps quaternion@2.2.0 >/dev/null
cat > rpy.js <<'JS'
const module_ = require('quaternion');
const Quaternion = module_.Quaternion ?? module_.default ?? module_;
const about = (axis, angle) => Quaternion.fromAxisAngle(axis, angle);
const urdf = (roll, pitch, yaw) => about([0, 0, 1], yaw).mul(about([0, 1, 0], pitch)).mul(about([1, 0, 0], roll));
const degrees = (a, b) => {
  const dot = Math.abs(a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z);
  return Number(((2 * Math.acos(Math.min(1, dot))) * 180 / Math.PI).toFixed(1));
};
const off = (roll, pitch, yaw) => [Quaternion.fromEuler(roll, pitch, yaw, 'RPY'), Quaternion.fromEuler(yaw, pitch, roll, 'YPR'),
  Quaternion.fromEulerLogical(roll, pitch, yaw, 'RPY')].map((q) => degrees(q, urdf(roll, pitch, yaw))).join();
const found = [[0, 0, 0.3], [0.1, 0.2, 0.3], [0.5, 0.5, 0.5]].map((angles) => off(...angles));
console.log('degrees from URDF by RPY, YPR, logical RPY:', found.join(' | '));
if (found.join(' ') !== process.argv[2]) { console.error('changed: differences are ' + found.join(' ')); process.exit(1); }
JS
node rpy.js '0,0,0 4,0,0 23.8,0,0'
