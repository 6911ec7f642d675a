#!/usr/bin/env bash
# cyclonedds 11.0.1 (Python): a sample that is 20 s old is delivered with a lifespan of 5 s.
#
# Expected: DDS 1.4 (2.2.3.16) adds the lifespan to the source timestamp: a sample stamped in the
# past has expired when it is written, one stamped in the future lives longer.
# Seen: the stamp given to `write` does not count. The old one is there, and one that is stamped 20
# s ahead is gone when its lifespan of 1 s is over by the clock of the machine.
# So: lifespans do not keep old data from being used in replays or under simulated time; compare the
# stamp in the reader.
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
    number: int32

participant = DomainParticipant(32)
second = 10**9

def samples(name, shift_s, lifespan_s, wait_s):
    reliable = (Policy.Reliability.Reliable(duration(seconds=5)), Policy.History.KeepAll)
    topic = Topic(participant, name, Sample)
    writer = DataWriter(participant, topic, qos=Qos(*reliable, Policy.Lifespan(duration(seconds=lifespan_s))))
    reader = DataReader(participant, topic, qos=Qos(*reliable))
    deadline = time.monotonic() + 20
    while not writer.get_matched_subscriptions() and time.monotonic() < deadline:
        time.sleep(0.01)
    writer.write(Sample(1), timestamp=time.time_ns() + shift_s * second)
    time.sleep(wait_s)
    return len(reader.take(N=9))

found = {"stamped 20 s ago, lifespan 5 s, read after 0.2 s": samples("old", -20, 5, 0.2),
         "stamped 20 s ahead, lifespan 1 s, read after 3 s": samples("ahead", 20, 1, 3.0)}
for name, count in found.items():
    print(f"{name}: {count} samples")
if list(found.values()) != [1, 0]:
    sys.exit("changed: samples are %s" % found)
PY
