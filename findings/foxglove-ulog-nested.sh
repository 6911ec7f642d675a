#!/usr/bin/env bash
# @foxglove/ulog 2.3.2: a nested type without a timestamp of its own ends the reading of a PX4 log
# (pyulog 1.3.0 reads it).
#
# Expected: the ULog format lets a field have the name of another format as its type; only a message
# that is logged by itself begins with a timestamp.
# Seen: the file opens, and `readMessages` throws at the first message with such a field: 'Message
# "vec3" is missing a timestamp field'; what comes later is lost. pyulog makes the columns v.x and
# v.y.
# So: catch the error per file and fall back to pyulog, or log flat fields.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyulog==1.3.0
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund @foxglove/ulog@2.3.2 >/dev/null
"$dir/venv/bin/python" - <<'PY'
import struct
import sys
from pyulog import ULog

message = lambda kind, body: struct.pack("<HB", len(body), ord(kind)) + body
parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000), message("B", bytes(40)),
         message("F", b"pos:uint64_t timestamp;float x;vec3 v;"), message("F", b"vec3:float x;float y;"),
         message("F", b"alt:uint64_t timestamp;float z;"),
         message("A", struct.pack("<BH", 0, 0) + b"pos"), message("A", struct.pack("<BH", 0, 1) + b"alt"),
         message("D", struct.pack("<HQf", 1, 2000, 7.0)), message("D", struct.pack("<HQfff", 0, 3000, 1.5, 1.0, 2.0)),
         message("D", struct.pack("<HQf", 1, 4000, 8.0))]
open("a.ulg", "wb").write(b"".join(parts))
read = {data.name: {name: values.tolist() for name, values in data.data.items()} for data in ULog("a.ulg").data_list}
print("pyulog:", read)
if read["pos"] != {"timestamp": [3000], "x": [1.5], "v.x": [1.0], "v.y": [2.0]} or read["alt"]["z"] != [7.0, 8.0]:
    sys.exit("changed: pyulog reads %s" % read)
PY
cat > read.mjs <<'JS'
import fs from 'node:fs';
import {ULog} from '@foxglove/ulog';
const data = fs.readFileSync('a.ulg');
const log = new ULog({
  open: async () => data.length, close: async () => {}, size: () => data.length,
  read: async (offset, length) => new Uint8Array(data.subarray(offset, offset + length)),
});
await log.open();
const read = [];
let refusal = '';
try {
  for await (const message of log.readMessages()) if (message.value) read.push(Number(message.value.timestamp));
} catch (error) {
  refusal = error.message;
}
console.log('@foxglove/ulog:', log.messageCount(), 'messages, stamps read:', read, refusal);
if (!refusal.includes('missing a timestamp') || read.join() !== '2000') {
  console.error('changed: it reads ' + read);
  process.exit(1);
}
JS
node read.mjs
