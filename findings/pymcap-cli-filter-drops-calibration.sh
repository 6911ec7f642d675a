#!/usr/bin/env bash
# pymcap-cli 0.34.0 (Python): cutting off the first seconds drops the attachments.
#
# Expected: `filter` by time cuts messages. Its help on attachments: "Defaults to include
# (filtering is lossless by default)".
# Seen: `filter --start +5s` leaves out the attachment of the calibration, which a recorder
# writes when it begins, because the time of the attachment is before the window; `--attachments
# include` changes nothing. Metadata records, which have no time, stay. The tool says "Filter
# completed successfully!" and ends with 0; a line of its statistics counts "Attachments: 0
# written (1 processed)".
# So: add attachments again after a cut by time (`get`, `add attachment`), or stamp them late.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pymcap-cli==0.34.0 mcap==1.6.0
"$dir/venv/bin/python" - <<'PY'
from mcap.writer import Writer

with open("in.mcap", "wb") as stream:
    writer = Writer(stream)
    writer.start("ros2")
    schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
    channel = writer.register_channel("/a", "cdr", schema)
    writer.add_attachment(10**9, 10**9, "camera.yaml", "application/yaml", b"fx: 525.0\n")
    writer.add_metadata("session", {"robot": "7"})
    for second in range(1, 20):
        writer.add_message(channel, second * 10**9, b"\0\1\0\0\0", second * 10**9)
    writer.finish()
PY
cut() { # NAME FLAGS...
    local name=$1
    shift
    "$dir/venv/bin/pymcap-cli" filter in.mcap -o "$name" -f "$@" >"$name.log" 2>&1 </dev/null
    grep -q 'Filter completed successfully' "$name.log" || {
        echo "changed: it says something else" >&2
        exit 1
    }
}
cut all.mcap
cut late.mcap --start +5s
cut included.mcap --start +5s --attachments include
cut early.mcap --end +5s
"$dir/venv/bin/python" - <<'PY'
import sys
from mcap.reader import make_reader

found = {}
for name in ("in", "all", "late", "included", "early"):
    with open(f"{name}.mcap", "rb") as stream:
        reader = make_reader(stream)
        seconds = [message.log_time // 10**9 for _, _, message in reader.iter_messages()]
        attached = [attachment.name for attachment in reader.iter_attachments()]
        found[name] = attached
        metadata = [record.name for record in reader.iter_metadata()]
        print(f"{name}: {seconds[0]} to {seconds[-1]} s, attachments {attached}, metadata {metadata}")
if found != {"in": ["camera.yaml"], "all": ["camera.yaml"], "late": [], "included": [], "early": ["camera.yaml"]}:
    sys.exit("changed: %s" % found)
PY
