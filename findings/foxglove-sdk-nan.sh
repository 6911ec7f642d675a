#!/usr/bin/env bash
# foxglove-sdk 0.30.3 (Python): a NaN in a logged dict makes a message that no JSON parser of a
# browser reads.
#
# Expected: a channel of encoding `json` holds JSON (RFC 8259 has no NaN); a range without return
# is null, or refused.
# Seen: `foxglove.log("/a", {"x": float("nan")})` writes `{"x": NaN}`, and infinity as `Infinity`.
# Python reads it back, JSON.parse and jq do not, so the fault is met on another machine.
# So: map non-finite numbers to None before logging dicts; a reader of JSON channels is told which
# message is broken rather than that the file is. The typed messages (protobuf) have no such limit.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check foxglove-sdk==0.30.3 mcap==1.6.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import foxglove
from mcap.reader import make_reader

writer = foxglove.open_mcap(sys.argv[1] + "/a.mcap")
foxglove.log("/a", {"x": float("nan"), "y": float("inf")}, log_time=1)
writer.close()
_, channel, message = next(iter(make_reader(open(sys.argv[1] + "/a.mcap", "rb")).iter_messages()))
open(sys.argv[1] + "/a.json", "wb").write(message.data)
print("encoding", channel.message_encoding, "data", message.data.decode())
if channel.message_encoding != "json" or b"NaN" not in message.data or b"Infinity" not in message.data:
    sys.exit("changed: the message is %r" % message.data)
PY
cat > "$dir/read.mjs" <<'JS'
import fs from 'node:fs';
try {
  JSON.parse(fs.readFileSync(process.argv[2], 'utf8'));
  console.error('changed: JSON.parse reads it');
  process.exit(1);
} catch (error) {
  console.log('JSON.parse:', error.message.slice(0, 40));
}
JS
node "$dir/read.mjs" "$dir/a.json"
