#!/usr/bin/env bash
# mcap 1.6.0 (Python): two options of its writer make files that its seeking reader cannot read, or
# reads without their attachments.
#
# Expected: the specification makes the copies of schemas and channels in the summary optional, and
# indexes too; a file without them is slower to read, and complete.
# Seen: with `repeat_channels=False` the seeking reader raises KeyError at the first message
# (`NonSeekingReader` of the same package and @mcap/core 2.2.2 read the file). With
# `IndexType.NONE`, or without the attachment index, `iter_attachments` and `iter_metadata` yield
# nothing, though both are in the file and `NonSeekingReader` finds them.
# So: "no attachments" means "none indexed": take NonSeekingReader for checks, and writers keep
# all.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap==1.6.0
"$dir/venv/bin/python" - <<'PY'
import io
import sys
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.writer import IndexType, Writer

def write(**options):
    file = io.BytesIO()
    writer = Writer(file, **options)
    writer.start()
    channel = writer.register_channel("/a", "json", writer.register_schema("s", "jsonschema", b"{}"))
    writer.add_message(channel, 1, b"{}", 1)
    writer.add_attachment(1, 1, "map.txt", "text/plain", b"hello")
    writer.add_metadata("run", {"seed": "1"})
    writer.finish()
    return file.getvalue()

def read(reader, data):
    try:
        messages = len(list(reader(io.BytesIO(data)).iter_messages()))
    except KeyError as error:
        messages = "KeyError(%s)" % error
    attachments = [a.name for a in reader(io.BytesIO(data)).iter_attachments()]
    return messages, attachments, [m.name for m in reader(io.BytesIO(data)).iter_metadata()]

found = {}
for name, data in (("repeat_channels=False", write(repeat_channels=False)), ("IndexType.NONE", write(index_types=IndexType.NONE))):
    found[name] = read(SeekingReader, data), read(NonSeekingReader, data)
    print(f"{name}: seeking {found[name][0]}, not seeking {found[name][1]}")
whole = (1, ["map.txt"], ["run"])
if found["repeat_channels=False"] != (("KeyError(1)", ["map.txt"], ["run"]), whole):
    sys.exit("changed: without repeated channels it is %s" % (found["repeat_channels=False"],))
if found["IndexType.NONE"] != ((1, [], []), whole):
    sys.exit("changed: without indexes it is %s" % (found["IndexType.NONE"],))
PY
