#!/usr/bin/env bash
# kappe 0.25.0 (Python): a conversion that changes nothing loses what is no message, without a word.
#
# Expected: `kappe convert` without a configuration, and `kappe cut` of a whole file, write all of a
# recording again: messages, attachments (calibrations, maps, scenarios) and metadata records.
# Seen: the messages are there, the attachment and the metadata record are not, and the exit code is
# 0 without a warning. In their place `convert` puts an attachment and a record of its own.
# So: keep the originals of converted recordings, or copy attachments and metadata afterwards.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check kappe==0.25.0 mcap==1.6.0 numpy==2.2.6
"$dir/venv/bin/python" - <<'PY'
from mcap.writer import Writer

with open("in.mcap", "wb") as stream:
    writer = Writer(stream)
    writer.start("ros2")
    # Without this type kappe fetches it from the network.
    schema = writer.register_schema("tf2_msgs/msg/TFMessage", "ros2msg", b"string data")
    channel = writer.register_channel("/a", "cdr", schema)
    writer.add_attachment(0, 0, "camera.yaml", "application/yaml", b"fx: 525.0\n")
    writer.add_metadata("session", {"robot": "7"})
    for time in range(3):
        writer.add_message(channel, time * 10**9, b"\0\1\0\0\2\0\0\0a\0", time * 10**9)
    writer.finish()
PY
printf 'splits:\n  - start: 0\n    end: 10\n    name: whole.mcap\n' >cut.yaml
ends() { # COMMAND...
    "$@" >>log 2>&1 || {
        cat log
        echo "changed: $* ended with $?" >&2
        exit 1
    }
}
ends "$dir/venv/bin/kappe" --progress false convert in.mcap converted
ends "$dir/venv/bin/kappe" --progress false cut --config cut.yaml --output cut in.mcap
if grep -i 'attachment\|WARNING' log; then
    echo "changed: it says something of attachments" >&2
    exit 1
fi
"$dir/venv/bin/python" - <<'PY'
import sys
from mcap.reader import make_reader

found = {}
for name in ("in.mcap", "converted/in.mcap", "cut/whole.mcap"):
    with open(name, "rb") as stream:
        reader = make_reader(stream)
        found[name] = (
            sum(1 for _ in reader.iter_messages()),
            [at.name for at in reader.iter_attachments()],
            [record.name for record in reader.iter_metadata()],
        )
    print(name, "messages, attachments, metadata:", *found[name])
if found != {
    "in.mcap": (3, ["camera.yaml"], ["session"]),
    "converted/in.mcap": (3, ["kappe_config.yaml"], ["kappe_metadata"]),
    "cut/whole.mcap": (3, [], []),
}:
    sys.exit(f"changed: {found}")
PY
