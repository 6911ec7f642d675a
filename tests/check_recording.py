"""Opens a recording with the usual Python packages, and checks it against itself and against
`maes info`.

    check_recording.py RECORDING.mcap INFO.txt METADATA.yaml FREE_CELLS

INFO.txt is the output of `maes info RECORDING.mcap`, METADATA.yaml that with `--metadata`,
FREE_CELLS the number of free cells of the true map. Prints a summary; exit code 1 with the reason
if a check fails.
"""

import math
import re
import shutil
import sys
import tempfile
import tomllib
from collections import Counter, defaultdict
from pathlib import Path

from mcap.reader import make_reader
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

TICK_NS = 20_000_000
RUNNING, ENDED = 0, 1
TYPES = {
    "/sim/scenario": "maes_msgs/msg/Scenario",
    "/sim/progress": "maes_msgs/msg/Progress",
    "/sim/digest": "maes_msgs/msg/Digest",
    "/sim/result": "maes_msgs/msg/Result",
    "/tf": "tf2_msgs/msg/TFMessage",
    "join": "maes_msgs/msg/Join",
    "observation": "maes_msgs/msg/Observation",
    "command": "maes_msgs/msg/Command",
}


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def stamp_ns(header):
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def cells(runs):
    return {cell for start, length in zip(runs.start, runs.length) for cell in range(start, start + length)}


def read_m3dm(data):
    """Size in x, y, z and the set of free cell indices, from the bytes of a map file, bit by bit.
    """
    bits = "".join(f"{byte:08b}" for byte in data)
    size_x, size_z, size_y, padding = int(bits[:7], 2), int(bits[7:14], 2), int(bits[14:21], 2), int(bits[21:24], 2)
    body = bits[24 + padding :]
    check(len(body) == size_x * size_y * size_z, "the map has as many bits as cells")
    free = set()
    position = 0
    for x in range(size_x):
        for z in range(size_z):
            for y in range(size_y):
                if body[position] == "0":
                    free.add((z * size_y + y) * size_x + x)
                position += 1
    return (size_x, size_y, size_z), free


class Recording:
    """Everything in the file, decoded with `mcap` and `mcap-ros2-support`."""

    def __init__(self, file):
        self.messages = defaultdict(list)
        self.bytes = Counter()
        with open(file, "rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            check(reader.get_header().profile == Profile.ROS2, "the profile is ros2")
            self.summary = reader.get_summary()
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
                check(message.log_time == message.publish_time, "both stamps are sim time")
                self.messages[channel.topic].append((message.log_time, decoded))
                self.bytes[channel.topic] += len(message.data)
            self.attachments = {attachment.name: attachment for attachment in reader.iter_attachments()}

    def of(self, topic):
        return [message for _, message in self.messages[topic]]


def check_formats(recording):
    for schema in recording.summary.schemas.values():
        check(schema.encoding == SchemaEncoding.ROS2, f"{schema.name} is ros2msg")
    for channel in recording.summary.channels.values():
        check(channel.message_encoding == MessageEncoding.CDR, f"{channel.topic} is cdr")
        schema = recording.summary.schemas[channel.schema_id].name
        expected = TYPES.get(channel.topic) or TYPES[re.fullmatch(r"/agent_\d+/(\w+)", channel.topic)[1]]
        check(schema == expected, f"{channel.topic} is {expected}, not {schema}")
        check("reliability: 1" in channel.metadata["offered_qos_profiles"], f"{channel.topic} says its QoS")
        check(re.fullmatch("RIHS01_[0-9a-f]{64}", channel.metadata["topic_type_hash"]), f"{channel.topic} says its type hash")
    for index in recording.summary.chunk_indexes:
        check(index.compression == "zstd", "chunks are compressed")


def check_counts(recording, info):
    lines = re.findall(r"^ *(\d+) +(\d+) (/\S+)$", info, re.MULTILINE)
    listed = {topic: (int(count), int(size)) for count, size, topic in lines}
    found = {topic: (len(messages), recording.bytes[topic]) for topic, messages in recording.messages.items()}
    check(listed == found, f"`info` counts {listed}, there are {found}")


def check_rosbags(recording, bag):
    counts = Counter()
    ticks = defaultdict(list)
    with AnyReader([Path(bag)]) as reader:
        for connection, time_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] += 1
            ticks[connection.topic].append((time_ns, getattr(message, "tick", None)))
    check(counts == {topic: len(messages) for topic, messages in recording.messages.items()}, "rosbags reads as much")
    for topic, messages in recording.messages.items():
        expected = [(time_ns, getattr(message, "tick", None)) for time_ns, message in messages]
        check(sorted(ticks[topic], key=str) == sorted(expected, key=str), f"rosbags reads the same in {topic}")


def check_folder(recording, file, metadata_file):
    """A folder with the recording and its metadata is a bag of rosbag2."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(file, folder)
        shutil.copy(metadata_file, Path(folder, "metadata.yaml"))
        check_rosbags(recording, folder)
        with AnyReader([Path(folder)]) as reader:
            total = sum(map(len, recording.messages.values()))
            check(reader.message_count == total, f"the metadata counts {reader.message_count} messages, there are {total}")
            times = [time_ns for messages in recording.messages.values() for time_ns, _ in messages]
            span = (min(times), max(times) - min(times))
            # rosbags has the end of a bag behind its last message.
            found = (reader.start_time, reader.duration - 1)
            check(found == span, f"the metadata says {found}, there is {span}")


def check_stamps(recording):
    for topic, messages in recording.messages.items():
        times = [time_ns for time_ns, _ in messages]
        check(times == sorted(times), f"{topic} is in order")
        check(all(time_ns % TICK_NS == 0 for time_ns in times), f"{topic} has stamps of whole ticks")
        for time_ns, message in messages:
            if hasattr(message, "tick"):
                check(time_ns == message.tick * TICK_NS, f"{topic}: tick {message.tick} has the stamp {time_ns}")
            if hasattr(message, "header"):
                check(stamp_ns(message.header) == time_ns, f"{topic}: the header says the same")
                check(message.header.frame_id == "map", f"{topic}: the frame is map")


def whole_observations(parts):
    """Parts in order, put together: lists of parts."""
    observations = []
    for part in parts:
        if part.part == 0:
            observations.append([])
        check(part.part == len(observations[-1]), "parts come in order")
        check(part.tick == observations[-1][0].tick if observations[-1] else True, "parts are of one tick")
        observations[-1].append(part)
    for parts in observations:
        check(len(parts) == parts[0].parts, "no part is missing")
    return observations


def check_agents(recording, scenario, result, free, size):
    wall_seen = set()
    explored = set()
    for agent in range(scenario["agents"]["count"]):
        [join] = recording.of(f"/agent_{agent}/join")
        check((join.agent, join.instance) == (agent, 0), "a join holds nothing that differs between equal runs")
        observations = whole_observations(recording.of(f"/agent_{agent}/observation"))
        commands = recording.of(f"/agent_{agent}/command")
        check(all(part.agent == agent for parts in observations for part in parts), "observations name their agent")
        check(all(command.agent == agent for command in commands), "commands name their agent")
        check(observations[-1][0].phase == ENDED, "the last observation is the end")
        check(observations[-1][0].tick == result.tick, "the end is that of the run")
        requested = [parts[0].tick for parts in observations[:-1]]
        check(all(parts[0].phase == RUNNING for parts in observations[:-1]), "there is one end")
        check(requested == [command.tick for command in commands], "every observation has its command")
        check(requested == sorted(set(requested)), "no tick has two requests")
        seen = set()
        for part in (part for parts in observations for part in parts):
            new = cells(part.seen_free)
            check(not new & seen, "free cells are seen for the first time once")
            check(new <= free, "what is seen as free is free")
            check(cells(part.view_free) <= free and not cells(part.view_wall) & free, "views are true")
            check(part.has_view or not part.view_free.start, "there is no view unless it says so")
            wall_seen |= cells(part.seen_wall)
            seen |= new
            position = part.position
            cell = [math.floor(axis / scenario["map"]["cell_m"]) for axis in (position.x, position.y, position.z)]
            check((cell[2] * size[1] + cell[1]) * size[0] + cell[0] in free, "agents are in free cells")
        check(result.explored_by[agent] == len(seen) / len(free), f"the score of agent {agent} is what it has seen")
        explored |= seen
    check(not wall_seen & free, "what is seen as wall is wall")
    check(result.explored == len(explored) / len(free), "the score of the team is what it has seen")


def check_progress(recording, scenario, result):
    progress = recording.of("/sim/progress")
    check(progress[0].tick == 0 and progress[-1].tick == result.tick, "progress goes from start to end")
    check([p.tick for p in progress[:-1]] == list(range(0, progress[-1].tick, 500)), "progress comes every 10 s")
    agents = scenario["agents"]["count"]
    for share in ("explored", "covered"):
        team = [getattr(p, share) for p in progress]
        check(team == sorted(team), f"{share} does not decrease")
        check(0.0 <= team[0] and team[-1] <= 1.0, f"{share} is a fraction")
        check(team[-1] == getattr(result, share), f"{share} of the result is that of the last progress")
        for p in progress:
            one = getattr(p, f"{share}_by")
            check(len(one) == agents and max(one) <= getattr(p, share) <= sum(one) + 1e-9, f"{share}_by adds up")


def check_digests(recording, result, info):
    digests = recording.of("/sim/digest")
    last = digests[-1]
    check([d.tick for d in digests[:-1]] == list(range(0, last.tick, 50)), "there is a digest every second")
    check(len({bytes(d.digest) for d in digests}) == len(digests), "no two digests are the same")
    check((last.tick, bytes(last.digest)) == (result.tick, bytes(result.digest)), "the last digest is that of the result")
    check(info.splitlines()[-1] == f"digest: {bytes(result.digest).hex()}", "`info` ends with the digest")


def check_transforms(recording, scenario, result):
    period = scenario["recording"]["poses_period_ticks"]
    times = [time_ns // TICK_NS for time_ns, _ in recording.messages["/tf"]]
    check(times == list(range(0, result.tick + 1, period)), f"poses are recorded every {period} ticks")
    for message in recording.of("/tf"):
        frames = [(t.header.frame_id, t.child_frame_id) for t in message.transforms]
        check(frames == [("map", f"agent_{a}/base_link") for a in range(len(frames))], "transforms are from map to agents")
        for transform in message.transforms:
            q = transform.transform.rotation
            check(abs(math.hypot(q.x, q.y, q.z, q.w) - 1.0) < 1e-12, "rotations are unit quaternions")


def main(file, info_file, metadata_file, free_cells):
    recording = Recording(file)
    info = Path(info_file).read_text(encoding="utf-8")
    check(set(recording.attachments) == {"scenario.toml", "map.m3dm"}, "scenario and map are attached")
    scenario = tomllib.loads(recording.attachments["scenario.toml"].data.decode())
    check("execution" not in scenario, "the execution section is no part of it")
    size, free = read_m3dm(recording.attachments["map.m3dm"].data)
    check(len(free) == free_cells, f"the map has {len(free)} free cells, not {free_cells}")
    [announced] = recording.of("/sim/scenario")
    check(tuple(announced.size) == size and announced.agents == scenario["agents"]["count"], "agents receive the same")
    check(announced.agents_seed != scenario["seed"], "agents do not receive the seed of the map")
    [result] = recording.of("/sim/result")

    check_formats(recording)
    check_counts(recording, info)
    check_rosbags(recording, file)
    check_folder(recording, file, metadata_file)
    check_stamps(recording)
    check_agents(recording, scenario, result, free, size)
    check_progress(recording, scenario, result)
    check_digests(recording, result, info)
    check_transforms(recording, scenario, result)
    total = sum(map(len, recording.messages.values()))
    print(f"{total} messages on {len(recording.messages)} topics, {result.tick} ticks, {len(free)} free cells: all right")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]))
