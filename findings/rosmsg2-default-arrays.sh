#!/usr/bin/env bash
# @foxglove/rosmsg2-serialization 3.1.0: a default value of an array breaks the message behind it;
# mcap-ros2-support 0.6.0 ignores the default.
#
# Expected: `int32[] a [1, 2]` in a .msg file is a default (ROS 2 interface definition); a field
# left out when writing gets 1, 2, as a field `int32 x 5` gets 5.
# Seen: in JavaScript the length 0 is written and then the two elements: the next field starts in
# the middle of them (an int64 left at 0 is read as 8589934593). In Python the array is empty. Both
# honour defaults of numbers and strings, so that a first test passes.
# So: set every array when writing; a message type with array defaults is worth a warning.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap==1.6.0 mcap-ros2-support==0.6.0
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund @foxglove/rosmsg@5.0.5 @foxglove/rosmsg2-serialization@3.1.0 >/dev/null
"$dir/venv/bin/python" - <<'PY'
import io
import sys
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer

file = io.BytesIO()
writer = Writer(file)
schema = writer.register_msgdef("p/msg/M", "int32 x 5\nint32[] a [1, 2]\nint64 big\n")
writer.write_message("/t", schema, {}, log_time=1, publish_time=1)
writer.finish()
message = next(iter(read_ros2_messages(io.BytesIO(file.getvalue())))).ros_msg
print("Python:     x", message.x, "a", message.a, "big", message.big)
if (message.x, message.a, message.big) != (5, [], 0):
    sys.exit("changed: Python writes %s" % message)
PY
cat > write.mjs <<'JS'
import {parse} from '@foxglove/rosmsg';
import {MessageReader, MessageWriter} from '@foxglove/rosmsg2-serialization';
const definition = parse('int32 x 5\nint32[] a [1, 2]\nint64 big\n', {ros2: true});
const bytes = new MessageWriter(definition).writeMessage({});
const message = new MessageReader(definition).readMessage(bytes);
console.log('JavaScript: x', message.x, 'a', Array.from(message.a), 'big', message.big);
if (message.x !== 5 || message.a.length !== 0 || message.big !== 8589934593n) {
  console.error('changed: JavaScript writes ' + Buffer.from(bytes).toString('hex'));
  process.exit(1);
}
JS
node write.mjs
