#!/usr/bin/env bash
# pymcap-cli 0.34.0 (Python): `recover` keeps a damaged chunk, and a message gets another time.
#
# Expected: `recover` ("Recover data from a potentially corrupt MCAP file") checks the CRC that
# each chunk has, and leaves out, or names, a chunk whose bytes have changed.
# Seen: of ten messages at 0, 2, ... 18 s the one of 10 s is one of 9 s in the recovered file,
# because bytes of its time have changed on the disk. The chunk is "fast copied", with its old
# CRC: the tool says "Recovery completed successfully!", counts ten messages and no error, and
# ends with 0. A reader that checks CRCs refuses the new file as it refuses the old one; those
# that do not, as mcap's by default, take the wrong time for the right one.
# `--always-decode-chunk` finds the damage, and ends with 1.
# So: recover with that option, or read the result once with CRCs checked.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pymcap-cli==0.34.0 mcap==1.6.0
"$dir/venv/bin/python" - <<'PY'
from mcap.writer import CompressionType, Writer

with open("good.mcap", "wb") as stream:
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start("ros2")
    schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
    channel = writer.register_channel("/a", "cdr", schema)
    for second in range(0, 20, 2):
        writer.add_message(channel, second * 10**9, b"\0\1\0\0\0", second * 10**9)
    writer.finish()
data = bytearray(open("good.mcap", "rb").read())
ten, nine = ((second * 10**9).to_bytes(8, "little") for second in (10, 9))
at = data.index(ten)
data[at : at + 8] = nine
open("damaged.mcap", "wb").write(data)
PY
recovered() { # NAME FLAGS...: recovers, and says with which code
    local name=$1 code=0
    shift
    "$dir/venv/bin/pymcap-cli" recover damaged.mcap -o "$name.mcap" -f "$@" >"$name.log" 2>&1 </dev/null || code=$?
    echo "recover $*: code $code, $(grep -o 'Recovery completed[^!]*!' "$name.log" || echo 'no success')"
}
recovered plain
recovered decoded --always-decode-chunk
grep -q 'Recovery completed successfully' plain.log || {
    echo "changed: it says something else" >&2
    exit 1
}
"$dir/venv/bin/python" - <<'PY'
import sys
from mcap.reader import make_reader

def times(name, is_checked):
    try:
        with open(name, "rb") as stream:
            reader = make_reader(stream, validate_crcs=is_checked)
            return [message.log_time // 10**9 for _, _, message in reader.iter_messages()]
    except Exception as error:
        return type(error).__name__

found = {name: (times(name, False), times(name, True)) for name in ("good.mcap", "plain.mcap", "decoded.mcap")}
for name, (unchecked, checked) in found.items():
    print(f"{name}: seconds {unchecked}, with CRCs checked {checked}")
right = list(range(0, 20, 2))
wrong = sorted(9 if second == 10 else second for second in right)
if found["good.mcap"] != (right, right) or found["plain.mcap"][0] != wrong or isinstance(found["plain.mcap"][1], list):
    sys.exit("changed: %s" % found)
PY
