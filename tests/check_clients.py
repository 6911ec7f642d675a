"""Reads a recording with programs of others, for tests/clients.rs, and compares what they find
with what the package `mcap` reads.

    check_clients.py RECORDING.mcap CONVERTED

kappe writes it again into the folder CONVERTED, baglint and tracecheck check it against what it
has, the reader of datasets of foxglove-sdk reads it through its index. Prints a line for each; exit
code 1 with the reason if something differs.
"""

import json
import subprocess
import sys
from collections import defaultdict
from datetime import datetime, timezone
from pathlib import Path

from foxglove.datasets.storage import ObjectLocation, _iter_messages
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

START = datetime.fromtimestamp(0, timezone.utc)
END = datetime.fromtimestamp(1e6, timezone.utc)


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def program(name, *arguments):
    """The output of a program of this environment, which has to succeed."""
    command = [str(Path(sys.executable).with_name(name)), *map(str, arguments)]
    ended = subprocess.run(command, capture_output=True, text=True)
    check(ended.returncode == 0, f"{command}: exit code {ended.returncode}\n{ended.stdout}{ended.stderr}")
    return ended.stdout


def sorted_by_topic(messages):
    """Schema, encoding and messages of each topic, in the order of their times."""
    topics = defaultdict(list)
    for schema, channel, message, *_ in messages:
        kind = (schema.name, schema.encoding, schema.data, channel.message_encoding)
        topics[channel.topic, kind].append((message.log_time, message.publish_time, bytes(message.data)))
    return {topic: sorted(found, key=lambda message: message[0]) for topic, found in topics.items()}


def read(file):
    with open(file, "rb") as stream:
        return sorted_by_topic(make_reader(stream).iter_messages())


class Files:
    """The object store of a machine."""

    def open(self, location):
        return open(location.path, "rb", buffering=0)


def check_foxglove(file, expected):
    topics = [topic for topic, _ in expected]
    location = ObjectLocation(bucket="", path=str(file))
    found = list(_iter_messages(Files(), [location], topics, START, END, [DecoderFactory()]))
    check(sorted_by_topic(found) == expected, "foxglove-sdk reads other messages")
    # What it decodes is what it is for.
    results = [decoded for _, channel, _, decoded in found if channel.topic == "/sim/result"]
    check(len(results) == 1 and 0.0 < results[0].explored <= 1.0, f"foxglove-sdk: {results}")
    some = [topic for topic in topics if topic.startswith("/agent_1/")]
    part = list(_iter_messages(Files(), [location], some, START, END, [DecoderFactory()]))
    check({channel.topic for _, channel, _, _ in part} == set(some), "foxglove-sdk: topics by name")
    print(f"foxglove-sdk: {len(found)} messages")


def check_baglint(file, expected):
    spec = file.with_suffix(".spec.yaml")
    spec.write_text(program("baglint", file, "--init"))
    report = json.loads(program("baglint", file, "-s", spec, "--strict", "-f", "json"))
    count = sum(map(len, expected.values()))
    check((report["topics"], report["messages"]) == (len(expected), count), f"baglint: {report}")
    check(report["findings"] == [], f"baglint: {report}")
    print(f"baglint: {report['messages']} messages, {report['duration_s']} s")


def check_tracecheck(file, expected):
    topics = {}
    for (topic, (name, encoding, _, message_encoding)), messages in expected.items():
        times = [log_time for log_time, _, _ in messages]
        gaps = [later - time for time, later in zip(times, times[1:])]
        topics[topic] = {
            "required": True,
            "message_encoding": message_encoding,
            "schema_name": name,
            "schema_encoding": encoding,
            "min_count": len(messages),
            "max_count": len(messages),
            "clock_confirmed": True,
            "time_basis": "log_time",
            "check_regression": True,
        }
        if gaps:
            topics[topic] |= {"max_gap_ns": max(gaps), "interval_ns": [times[0], times[-1]], "boundary_tolerance_ns": 0}
    contract, out = file.with_suffix(".contract.json"), file.with_suffix(".tracecheck")
    contract.write_text(json.dumps({"version": 1, "name": "all", "profile": "ros2", "topics": topics}))
    program("tracecheck", "check", file, "--contract", contract, "--out", out, "--quiet")
    print(f"tracecheck: {len(topics)} topics")


def check_kappe(file, converted, expected):
    program("kappe", "--progress", "false", "convert", file, converted)
    check(read(converted / file.name) == expected, "kappe has written other messages")
    print(f"kappe: {len(expected)} topics")


def main():
    file, converted = Path(sys.argv[1]), Path(sys.argv[2])
    expected = read(file)
    check_foxglove(file, expected)
    check_baglint(file, expected)
    check_tracecheck(file, expected)
    check_kappe(file, converted, expected)


if __name__ == "__main__":
    main()
