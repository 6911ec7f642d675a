#!/usr/bin/env bash
# mcap 1.6.0 (Python): `reverse=True` has two orders, by whether the file can be sought in.
#
# Expected: `make_reader` picks a reader by the stream, and both give the same messages in the same
# order; reverse is the forward order turned round.
# Seen: messages of one log time (a simulator writes all of a tick with one) come turned round from
# a file, and in file order from a stream that cannot seek. With `log_time_order=False` the one
# raises ValueError, the other ignores `reverse` and reads forwards.
# So: "the last message at or before t" gives another message when a recording comes through a
# pipe. Break ties by `sequence`, or reverse a list.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap==1.6.0
"$dir/venv/bin/python" - <<'PY'
import io
import sys
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.writer import Writer

file = io.BytesIO()
writer = Writer(file)
writer.start()
channel = writer.register_channel("/a", "json", 0)
for number, time in enumerate((5, 5, 3, 3, 5)):
    writer.add_message(channel, time, str(number).encode(), time)
writer.finish()

def read(reader, **options):
    try:
        return " ".join(m.data.decode() for _, _, m in reader(io.BytesIO(file.getvalue())).iter_messages(**options))
    except ValueError as error:
        return "ValueError"

found = {}
for options in ({}, {"reverse": True}, {"reverse": True, "log_time_order": False}):
    found[tuple(options)] = read(SeekingReader, **options), read(NonSeekingReader, **options)
    print(options or "forwards", "| seeking:", found[tuple(options)][0], "| not seeking:", found[tuple(options)][1])
if list(found.values()) != [("2 3 0 1 4",) * 2, ("4 1 0 3 2", "0 1 4 2 3"), ("ValueError", "0 1 2 3 4")]:
    sys.exit("changed: orders are %s" % found)
PY
