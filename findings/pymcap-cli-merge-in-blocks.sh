#!/usr/bin/env bash
# pymcap-cli 0.34.0 (Python): `merge` does not interleave the messages of its files.
#
# Expected: "Merge multiple MCAP files chronologically by timestamp into a single output file.
# Messages are interleaved in time order across all input files."
# Seen: of two recordings of the same 20 s, /odom in even seconds and /scan in odd ones, the
# merged file has all of /odom up to 18 s first, then all of /scan from 1 s on: whole chunks are
# copied one after the other. It ends with 0. Whatever reads the file as a stream, as a player
# of a pipe, a recovery or a `head` does, gets the scans 18 s late. `sort` puts the merged file
# in order.
# So: run `pymcap-cli sort` after `merge`, or read by the index alone.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pymcap-cli==0.34.0 mcap==1.6.0
"$dir/venv/bin/python" - <<'PY'
from mcap.writer import Writer

for topic, first in (("odom", 0), ("scan", 1)):
    with open(f"{topic}.mcap", "wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel(f"/{topic}", "cdr", schema)
        for second in range(first, 20, 2):
            writer.add_message(channel, second * 10**9, b"\0\1\0\0\0", second * 10**9)
        writer.finish()
PY
"$dir/venv/bin/pymcap-cli" merge odom.mcap scan.mcap -o merged.mcap -f >log 2>&1 </dev/null
"$dir/venv/bin/pymcap-cli" sort merged.mcap -o sorted.mcap -f >>log 2>&1 </dev/null
"$dir/venv/bin/python" - <<'PY'
import sys
from mcap.reader import NonSeekingReader, make_reader

def in_file_order(name):
    with open(name, "rb") as stream:
        return [message.log_time // 10**9 for _, _, message in NonSeekingReader(stream).iter_messages(log_time_order=False)]

with open("merged.mcap", "rb") as stream:
    by_index = [message.log_time // 10**9 for _, _, message in make_reader(stream).iter_messages()]
merged, ordered = in_file_order("merged.mcap"), in_file_order("sorted.mcap")
print("merged, as a stream:", merged)
print("merged, by index:   ", by_index)
print("sorted, as a stream:", ordered)
if merged != [*range(0, 20, 2), *range(1, 20, 2)] or by_index != list(range(20)) or ordered != list(range(20)):
    sys.exit("changed")
PY
