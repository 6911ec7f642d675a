#!/usr/bin/env bash
# cyclonedds 11.0.1 (Python): a writer that keeps all hands one sample to a late reader.
#
# Expected: TRANSIENT_LOCAL with KEEP_ALL, or KEEP_LAST 5, means that a reader which comes later
# still gets what the writer keeps: all, or five.
# Seen: it gets the last one per instance, in both cases. What is kept for late readers is governed
# by a third policy, DURABILITY_SERVICE, whose default history is KEEP_LAST 1; `rmw_cyclonedds`
# sets it, a plain DDS node has to. With `Policy.DurabilityService(..., KeepLast(5), ...)` five
# arrive.
# So: a latched topic of several messages keeps only the last for whoever comes later; set both
# histories alike.
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
from cyclonedds.idl.annotations import key
from cyclonedds.idl.types import int32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

@dataclass
class Message(IdlStruct, typename="Message"):
    id: int32
    key("id")
    value: int32

domain = Domain(77, '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/>'
                    '</Interfaces></General></Domain></CycloneDDS>')
here, there = DomainParticipant(77), DomainParticipant(77)
base = [Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal]
service = Policy.DurabilityService(0, Policy.History.KeepLast(5), -1, -1, -1)
found = {}
for name, policies in {"keep_all": [Policy.History.KeepAll], "keep_last_5": [Policy.History.KeepLast(5)],
                       "with_durability_service": [Policy.History.KeepLast(5), service]}.items():
    writer = DataWriter(here, Topic(here, name, Message), qos=Qos(*base, *policies))
    for value in range(10):
        writer.write(Message(1, value))
    reader = DataReader(there, Topic(there, name, Message), qos=Qos(*base, Policy.History.KeepAll))
    samples, end = [], time.monotonic() + 10
    reader.wait_for_historical_data(duration(seconds=5))
    while not samples and time.monotonic() < end:
        samples += reader.take(100)
        time.sleep(0.05)
    time.sleep(0.5)
    found[name] = [sample.value for sample in samples + reader.take(100)]
    print(name, found[name])
if found != {"keep_all": [9], "keep_last_5": [9], "with_durability_service": [5, 6, 7, 8, 9]}:
    sys.exit("changed: late readers get %s" % found)
PY
