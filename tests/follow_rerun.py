"""Follows a recording for Rerun while it grows, for tests/rerun.rs.

    follow_rerun.py RECORDING.mcap GROWING.mcap FILE.rrd

The second file grows to the first one, record by record.
"""

import struct
import sys

import rerun as rr
from maes import RecordingFollower
from maes.rerun import Sender, blueprint

MAGIC_BYTES = 8
CHUNK, DATA_END = 0x06, 0x0F


def records(data):
    """Kind and end of each record, up to the summary."""
    begin, kind = MAGIC_BYTES, None
    while kind != DATA_END:
        kind, length = struct.unpack_from("<BQ", data, begin)
        begin += struct.calcsize("<BQ") + length
        yield kind, begin


whole, growing, saved = sys.argv[1:]
with open(whole, "rb") as file:
    data = file.read()
ends = list(records(data))
with open(growing, "wb", buffering=0) as file:
    # Attachments are in a recording before it has its name.
    written = next(end for (_, end), (kind, _) in zip(ends, ends[1:]) if kind == CHUNK)
    file.write(data[:written])
    follower = RecordingFollower(growing)
    part = follower.read()
    assert not part.topics()
    stream = rr.RecordingStream("maes")
    stream.save(saved, default_blueprint=blueprint(part))
    sender = Sender(stream, part)
    parts = 0
    for _, end in ends:
        assert not follower.has_ended
        if end > written:
            file.write(data[written:end])
            written = end
            part = follower.read()
            parts += bool(part.topics())
            sender.send(part)
    # The end is read with the magic bytes behind the last record.
    file.write(data[written:])
    sender.send(follower.read())
    assert follower.has_ended
    stream.disconnect()
print(f"{parts} parts")
