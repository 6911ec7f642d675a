#!/usr/bin/env bash
# cyclonedds 11.0.1 (Python): two types of different names match, two of one name do not.
#
# Expected: a topic connects writers and readers of one type name (DDS 1.4: topic name and type
# name must be equal), which is how Fast DDS and RustDDS tell `Time` from `Clock`.
# Seen: with the type information that XTypes adds, the name is not looked at: `Other{id, v:
# int32}` reads what `Message{id, v: int32}` writes. `Message{id, v: float64}` is not matched with
# `Message{id, v: int32}`, and neither side raises or logs anything.
# So: a silent topic between two vendors may be a field type, not the name; ask
# `get_matched_subscriptions` and compare definitions, not names.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check cyclonedds==11.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
import time
from dataclasses import dataclass
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

@dataclass
class Message(IdlStruct, typename="Message"):
    id: int32
    v: int32

@dataclass
class SameName(IdlStruct, typename="Message"):
    id: int32
    v: float64

@dataclass
class OtherName(IdlStruct, typename="Other"):
    id: int32
    v: int32

domain = Domain(78, '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/>'
                    '</Interfaces></General></Domain></CycloneDDS>')
here, there = DomainParticipant(78), DomainParticipant(78)
qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal)
pairs = {}
for kind in (OtherName, SameName):
    pairs[kind] = (DataWriter(here, Topic(here, kind.__name__, Message), qos=qos),
                   DataReader(there, Topic(there, kind.__name__, kind), qos=qos))
    pairs[kind][0].write(Message(1, 7))
end = time.monotonic() + 10
while not pairs[OtherName][0].get_matched_subscriptions() and time.monotonic() < end:
    time.sleep(0.05)
time.sleep(1)
found = {kind.__name__: (len(writer.get_matched_subscriptions()), [s.v for s in reader.take(10)])
         for kind, (writer, reader) in pairs.items()}
print("matched, received:", found)
if found != {"OtherName": (1, [7]), "SameName": (0, [])}:
    sys.exit("changed: matches are %s" % found)
PY
