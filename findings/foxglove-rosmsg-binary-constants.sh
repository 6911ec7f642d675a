#!/usr/bin/env bash
# @foxglove/rosmsg 5.0.5: binary and octal constants of a ROS 2 message are 0, unless they have 64
# bits.
#
# Expected: rosidl_adapter, which the package names as its reference, reads integers as Python does:
# 0b101 is 5, 0o17 is 15, 1_000 is 1000, and 5.9 is an error.
# Seen: `uint8 FLAG=0b101` is 0 and `0o17` is 0, `1_000` is 1, 5.9 is 5, 1e3 is 1; hexadecimal is
# right. `int64 FLAG=0b101` is 5, and 1_000 of 64 bits an error. Default values are read the same
# way.
# So: a panel that names flags by such constants shows the wrong names; write masks in hexadecimal
# or decimal in .msg files.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --legacy-peer-deps @foxglove/rosmsg@5.0.5 >/dev/null
cat > constants.js <<'JS'
const {parse} = require('@foxglove/rosmsg');
const value = (line) => {
  try {
    const [{value: constant, defaultValue}] = parse(line, {ros2: true})[0].definitions;
    return String(constant ?? defaultValue);
  } catch (error) {
    return error.constructor.name;
  }
};
const expected = {'uint8 A=0b101': '0', 'uint8 A=0o17': '0', 'int32 A=1_000': '1', 'uint8 A=5.9': '5', 'int32 A=1e3': '1',
  'uint8 a 0b101': '0', 'uint8 A=0x1f': '31', 'int64 A=0b101': '5', 'int64 A=0o17': '15', 'int64 A=1_000': 'SyntaxError'};
const found = Object.fromEntries(Object.keys(expected).map((line) => [line, value(line)]));
console.log(found);
for (const [line, seen] of Object.entries(expected))
  if (found[line] !== seen) { console.error(`changed: ${line} is ${found[line]}`); process.exit(1); }
JS
node constants.js
