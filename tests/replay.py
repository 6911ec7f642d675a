"""A ROS 2 node that receives the messages of a replay, and controls it.

    replay.py SCENE [EXPECTED]

Needs rclpy, maes_msgs and simulation_interfaces (see launch_scripts/ros_env.sh). EXPECTED is a
file with a line for each expected message, `TOPIC TYPE HEX`, where HEX is its CDR with header. A
scene is a function of this file. Exit code 0; a failure goes to stderr, with exit code 1.
"""

import importlib
import struct
import sys

import rclpy
from maes_msgs.msg import Progress, Result
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from services import OK, PAUSED, PLAYING, QUITTING, STOPPED, TICK_NS, SERVICES, Caller, check, equal, number
from simulation_interfaces.msg import SimulatorFeatures

DEPTH = 20_000
TIME = ["get_simulator_features", "get_simulation_state", "set_simulation_state", "step_simulation"]
LATCHED = {
    "/map",
    "/robot_description",
    "/sim/contacts",
    "/sim/explored_map",
    "/sim/explored_octomap",
    "/sim/explored_points",
    "/sim/map",
    "/sim/map_points",
    "/sim/octomap",
    "/sim/progress",
    "/sim/result",
    "/sim/scenario",
    "/sim/unexplored",
    "/tf_static",
}


def caller():
    """A client of the services of the replay, as soon as they are available."""
    return Caller("replay", {name: SERVICES[name] for name in TIME + ["get_parameters", "set_parameters"]})


def is_latched(topic):
    return topic in LATCHED or topic.endswith("/path")


def qos_of(topic):
    reliability = ReliabilityPolicy.BEST_EFFORT if topic.endswith("/points") else ReliabilityPolicy.RELIABLE
    durability = DurabilityPolicy.TRANSIENT_LOCAL if is_latched(topic) else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=DEPTH, reliability=reliability, durability=durability)


def type_of(name):
    package, _, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


class Listener:
    """Subscribes to topics and keeps the received bytes."""

    def __init__(self, types):
        self.node = rclpy.create_node("listener")
        self.types = types
        self.received = {topic: [] for topic in types}
        for topic, kind in types.items():
            hear = self.received[topic].append
            self.node.create_subscription(type_of(kind), topic, hear, qos_of(topic), raw=True)


def expected_of(file):
    """The expected messages and the types, by topic."""
    messages, types = {}, {}
    with open(file, encoding="ascii") as lines:
        for line in lines:
            topic, kind, text = line.split()
            messages.setdefault(topic, []).append(bytes.fromhex(text))
            types[topic] = kind
    return messages, types


def same(got, expected):
    """Whether a sample is that message: it may have padding at its end, which the header counts."""
    padding = len(got) - len(expected)
    return 0 <= padding <= 3 and got[:2] == expected[:2] and got[4 : len(expected)] == expected[4:]


def subject(kind, data):
    """The key of a message of a latched topic: of a marker, `ns` and `id`, which follow stamp and
    frame.
    """
    if kind != "visualization_msgs/msg/Marker":
        return None
    body, texts = data[4:], []
    at = 8
    for _ in range(2):
        (length,) = struct.unpack_from("<I", body, at)
        texts.append(body[at + 4 : at + 3 + length].decode())
        at = (at + 4 + length + 3) // 4 * 4
    return texts[1], *struct.unpack_from("<i", body, at)


def everything(file):
    """Receives every message from the first tick to the last, and leaves the replay at its end."""
    expected, types = expected_of(file)
    listener = Listener({**types, "/clock": "rosgraph_msgs/msg/Clock"})
    print("ready", flush=True)
    one = caller()
    one.executor.add_node(listener.node)
    equal(one.state(), STOPPED, "at the start")
    # More than there are: the replay stops at its end.
    equal(one.code("step_simulation", steps=1_000_000), 4, "steps beyond the end")
    equal(one.state(), PAUSED, "at the end")

    def missing():
        reliable = [topic for topic in expected if not topic.endswith("/points")]
        return {topic: len(expected[topic]) - len(listener.received[topic]) for topic in reliable}

    # Recordings have no clock: the replay publishes one message for each tick.
    (result,) = expected["/sim/result"]
    last_tick = deserialize_message(result, Result).tick
    one.until(lambda: max(missing().values()) <= 0 and len(listener.received["/clock"]) > last_tick)
    for topic, messages in expected.items():
        got = listener.received[topic]
        if topic.endswith("/points"):
            # Best effort: lost messages are not resent.
            left = iter(messages)
            check(got and all(any(same(one, other) for other in left) for one in got), f"{topic}: some, in order")
        else:
            equal(len(got), len(messages), f"messages on {topic}")
            check(all(map(same, got, messages)), f"{topic}: the same bytes, in order")
    clocks = [deserialize_message(clock, Clock).clock for clock in listener.received["/clock"]]
    ticks = [(clock.sec * 1_000_000_000 + clock.nanosec) // TICK_NS for clock in clocks]
    equal(ticks, list(range(len(ticks))), "every tick once")
    print("everything", len(ticks), flush=True)


def tail(file):
    """Receives what a replay publishes that starts and ends by itself, also its last messages."""
    expected, types = expected_of(file)
    reliable = {topic: kind for topic, kind in types.items() if not topic.endswith("/points")}
    listener = Listener(reliable)
    print("ready", flush=True)
    seconds_of_silence, received = 0.0, 0
    while any(len(listener.received[topic]) < len(expected[topic]) for topic in reliable):
        rclpy.spin_once(listener.node, timeout_sec=0.1)
        now = sum(map(len, listener.received.values()))
        seconds_of_silence = 0.0 if now > received or not received else seconds_of_silence + 0.1
        received = now
        check(seconds_of_silence < 60.0, f"{received} messages arrive, and then none for a minute")
    for topic in reliable:
        check(all(map(same, listener.received[topic], expected[topic])), f"{topic}: the same bytes, in order")
    print("received", received, flush=True)


def late(file):
    """Subscribes after the last message, receives every latched one, and ends the replay."""
    expected, types = expected_of(file)
    last = {}
    for topic in filter(is_latched, expected):
        last.update({(topic, subject(types[topic], data)): data for data in expected[topic]})
    listener = Listener({topic: types[topic] for topic, _ in last})
    one = caller()
    one.executor.add_node(listener.node)

    def has_received_latched():
        latched = {}
        for topic, messages in listener.received.items():
            latched.update({(topic, subject(types[topic], data)): data for data in messages})
        return latched.keys() == last.keys() and all(same(latched[key], last[key]) for key in last)

    one.until(has_received_latched)
    equal(one.state(), PAUSED, "at the end")
    equal(one.set_state(QUITTING), OK, "quit")


def steps(_file):
    """Pause, steps and rate of a part of a recording, from tick 525 to 600; then plays it to its
    end.
    """
    listener = Listener({"/sim/progress": "maes_msgs/msg/Progress"})
    one = caller()
    one.executor.add_node(listener.node)
    features = set(one.call("get_simulator_features").features.features)
    check({SimulatorFeatures.SIMULATION_STATE_PAUSE, SimulatorFeatures.STEP_SIMULATION_MULTIPLE} <= features, features)
    check(not features & {SimulatorFeatures.SPAWNING, SimulatorFeatures.ENTITY_STATE_SETTING}, features)
    equal(one.state(), STOPPED, "at the start")
    progress = listener.received["/sim/progress"]
    one.until(lambda: progress)
    equal([deserialize_message(data, Progress).tick for data in progress], [500], "latched at the start")
    equal(one.ticks, [], "no time has passed")

    def step(count, last):
        equal(one.code("step_simulation", steps=count), OK, f"{count} steps")
        equal(one.state(), PAUSED, f"after {count} steps")
        one.until(lambda: one.ticks and one.ticks[-1] >= last)
        equal(one.ticks, list(range(525, last + 1)), "the clock moves by exactly the steps")

    step(1, 525)
    step(10, 535)
    equal(one.code("step_simulation", steps=0), 4, "no steps")
    equal(one.set_state(STOPPED), 0, "back to the beginning")
    equal(one.set_state(PLAYING), OK, "play")
    equal(one.code("step_simulation", steps=1), 3, "step while playing")
    equal(one.set_state(PAUSED), OK, "pause")
    # Messages in flight at the response arrive in the end.
    seen = None
    while seen != one.ticks[-1]:
        seen = one.ticks[-1]
        for _ in range(20):
            equal(one.state(), PAUSED, "it stays paused")
    step(3, seen + 3)
    equal(one.get("rate")[0].double_value, 0.001, "the pace")
    equal(one.set("rate", number(-1.0)).successful, False, "no such pace")
    equal(one.set("rate", number(0.0)).successful, True, "as fast as possible")
    equal(one.set_state(PLAYING), OK, "play")


def hold(_file):
    """Subscribes and stays for ever: the test suspends it."""
    types = {"/clock": "rosgraph_msgs/msg/Clock", "/tf": "tf2_msgs/msg/TFMessage"}
    listener = Listener(types)
    one = caller()
    one.executor.add_node(listener.node)
    equal(one.state(), STOPPED, "at the start")
    print("holds", flush=True)
    one.until(lambda: False)


def play(_file):
    """Resumes the replay."""
    equal(caller().set_state(PLAYING), OK, "play")


def main():
    rclpy.init()
    scenes = {scene.__name__: scene for scene in (everything, tail, late, steps, hold, play)}
    scenes[sys.argv[1]](sys.argv[2] if len(sys.argv) > 2 else None)
    print("done", flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
