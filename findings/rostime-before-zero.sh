#!/usr/bin/env bash
# @foxglove/rostime 1.1.3 and @foxglove/rosmsg2-serialization 3.1.0 (npm): a quarter of a second
# back becomes four seconds ahead.
#
# Expected: `fromSec(-0.25)` is { sec: -1, nsec: 750000000 }, since nanoseconds of a ROS duration
# count upwards from 0 (`uint32 nanosec`), as rclcpp and rclpy write it; or it throws, as `toString`
# of the same library does for negative times.
# Seen: it is { sec: -0, nsec: -250000000 }; the writer stores it as sec 0, nanosec 4044967296 with
# no complaint, so a reader has +4.04 s (or refuses more than 999999999 nanoseconds). `fromSec` and
# `toSec` of the library agree with each other, so its own tests do not see it.
# So: turn a negative number of seconds into a duration with `Math.floor`; `subtract` of the same
# library borrows as it should.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund @foxglove/rostime@1.1.3 @foxglove/rosmsg@5.0.5 @foxglove/rosmsg2-serialization@3.1.0 >/dev/null
cat > write.mjs <<'JS'
import * as time from '@foxglove/rostime';
import rosmsg from '@foxglove/rosmsg';
import serialization from '@foxglove/rosmsg2-serialization';
const {fromSec, subtract, toSec} = time.default ?? time;
const definition = rosmsg.parse('int32 sec\nuint32 nanosec', {ros2: true});
const writer = new serialization.MessageWriter(definition), reader = new serialization.MessageReader(definition);
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
const back = fromSec(-0.25), borrowed = subtract({sec: 1, nsec: 0}, {sec: 1, nsec: 250000000});
const read = reader.readMessage(writer.writeMessage({sec: back.sec, nanosec: back.nsec}));
const seconds = read.sec + read.nanosec / 1e9;
console.log('fromSec(-0.25):', back, '| toSec of it:', toSec(back), '| subtract:', borrowed);
console.log('written and read:', {...read}, 'that is', seconds, 's');
if (back.sec !== 0 || back.nsec !== -250000000) changed('fromSec gives ' + JSON.stringify(back));
if (borrowed.sec !== -1 || borrowed.nsec !== 750000000) changed('subtract gives ' + JSON.stringify(borrowed));
if (Math.abs(seconds - 4.044967296) > 1e-9) changed('it is written as ' + seconds);
JS
node write.mjs
