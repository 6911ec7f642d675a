#!/usr/bin/env bash
# cyclonedds 11.0.1 (Python): with the order of source stamps a reliable reader that keeps all loses
# samples.
#
# Expected: BY_SOURCE_TIMESTAMP sorts what a reader has by the stamps of the writers; a reliable
# pair with KEEP_ALL loses nothing.
# Seen: of five samples stamped 5, 1, 6, 2 and 3 the reader gets two (5 and 6): whatever is stamped
# before something that has arrived is dropped. In the order of reception all five arrive; equal
# stamps are kept.
# So: do not ask for source order where several writers or simulated time stamp samples; sort by the
# stamp in the message.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check cyclonedds==11.0.1
export CYCLONEDDS_URI='<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast></General></Domain></CycloneDDS>'
"$dir/venv/bin/python" - <<'PY'
import sys
import time
from dataclasses import dataclass
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import int32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

@dataclass
class Sample(IdlStruct, typename="Sample"):
    stamp: int32

participant = DomainParticipant(31)

def received(name, stamps, *order):
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=5)), Policy.History.KeepAll, *order)
    topic = Topic(participant, name, Sample)
    writer, reader = DataWriter(participant, topic, qos=qos), DataReader(participant, topic, qos=qos)
    deadline = time.monotonic() + 20
    while not writer.get_matched_subscriptions() and time.monotonic() < deadline:
        time.sleep(0.01)
    for stamp in stamps:
        writer.write(Sample(stamp), timestamp=stamp)
    read = []
    while len(read) < len(stamps) and time.monotonic() < deadline - 15:
        read += [sample.stamp for sample in reader.take(N=20)]
        time.sleep(0.01)
    return read

source = Policy.DestinationOrder.BySourceTimestamp
found = {"by reception": received("reception", [5, 1, 6, 2, 3]), "by source": received("source", [5, 1, 6, 2, 3], source),
         "by source, equal stamps": received("equal", [5, 5, 5], source)}
for name, stamps in found.items():
    print(f"{name}: {stamps}")
if list(found.values()) != [[5, 1, 6, 2, 3], [5, 6], [5, 5, 5]]:
    sys.exit("changed: samples are %s" % found)
PY
