"""A node of another implementation of rmw_zenoh's format, which observes and controls a run.

    zenoh_observer.py PORT SCENE

Needs the packages eclipse-zenoh and zenoh-ros2-sdk, and a router at this port of 127.0.0.1. Obeys
ROS_DOMAIN_ID. The definitions of messages are those of this project; the package makes key
expressions, type hashes, attachments and tokens of them. The server has started paused, with two
agents. Prints `done`. A failure goes to stderr, with exit code 1.
"""

import os
import queue
import re
import shutil
import struct
import sys
import tempfile
import time
from pathlib import Path

import zenoh
import zenoh.ext
import zenoh_ros2_sdk as sdk
from zenoh_ros2_sdk import discovery, message_registry
from zenoh_ros2_sdk.session import ZenohSession

MSGS = Path(__file__).resolve().parent.parent / "msgs"
ROUTER = {"router_ip": "127.0.0.1", "router_port": int(sys.argv[1])}
TICK_NS = 20_000_000
PLAYING, PAUSED, QUITTING = 1, 2, 3
OK = 1
# States of goals.
SUCCEEDED, CANCELLED = 4, 5
# Plain CDR, little-endian.
HEADER = bytes([0, 1, 0, 0])
# Of what ROS 2 Kilted installs for this type.
CLOCK_HASH = "RIHS01_" "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def equal(got, expected, words):
    check(got == expected, f"{words}: got {got}, expected {expected}")


def definitions(folder):
    """Copies the definitions of this project to where the package looks for them.

    Constants go: the package reads no blanks around their `=`.
    """
    standard = MSGS / "src/standard"
    files = [(path, "maes_msgs/msg") for path in (MSGS / "msg").glob("*.msg")]
    for package in standard.iterdir():
        files += [(path, f"{package.name}/msg") for path in package.glob("*.msg")]
        files += [(path, f"{package.name}/{path.parent.name}") for path in package.glob("*/*.[ms]*")]
    for path, place in files:
        (folder / place).mkdir(parents=True, exist_ok=True)
        lines = [line for line in path.read_text().splitlines() if not re.match(r"\w+ \w+ ?=", line)]
        (folder / place / path.name).write_text("\n".join(lines) + "\n")


def wait_until(found, words):
    """What `found` returns once that is something; the test limits the time."""
    print(f"waiting for {words}", file=sys.stderr)
    while not (result := found()):
        time.sleep(0.1)
    return result


class Topic:
    """A subscription that queues what it receives."""

    def __init__(self, name, kind):
        self.received = queue.Queue()
        self.subscriber = sdk.ROS2Subscriber(name, kind, self.received.put, **ROUTER)
        self.type_hash = self.subscriber.type_hash

    def next(self):
        return self.received.get()


class LatchedTopic(Topic):
    """A subscription that also receives what was sent before it, as in rmw_zenoh by the advanced
    subscriber. zenoh-ros2-sdk 0.1.8 does not find the publishers of topics with two slashes."""

    def __init__(self, name, kind):
        super().__init__(name, kind)
        session = self.subscriber.session_mgr
        self.subscriber.sub.undeclare()
        self.latched = zenoh.ext.declare_advanced_subscriber(
            session.session,
            self.subscriber.keyexpr,
            self.subscriber._listener,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True),
            subscriber_detection=True,
        )


class Service:
    """A client of a service of the server."""

    def __init__(self, name, kind):
        self.name = name
        self.client = sdk.ROS2ServiceClient(
            f"/sim_server/{name}", f"simulation_interfaces/srv/{kind}", timeout=600.0, **ROUTER
        )

    def call(self, **fields):
        response = self.client.call(**fields)
        check(response is not None, f"{self.name} answers nothing")
        equal(response.result.result, OK, f"{self.name}: {response.result.error_message}")
        return response


def message(kind, **fields):
    """A message, with empty values for what is not named."""
    session = ZenohSession.get_instance(**ROUTER)
    return session.register_message_type(None, kind)(**fields)


def publishers(topic):
    info = discovery.get_topic_info(topic, verbose=True, timeout=5.0, **ROUTER)
    return info.publishers if info else []


def nodes():
    session = ZenohSession.get_instance(**ROUTER)
    domain = os.environ["ROS_DOMAIN_ID"]
    replies = session.liveliness.get(f"@ros2_lv/{domain}/*/*/*/NN/**", timeout=5.0)
    return {str(reply.ok.key_expr).split("/")[8] for reply in replies if reply.ok}


def set_state(service, state):
    service.call(state=message("simulation_interfaces/msg/SimulationState", state=state))


def time_ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def whole():
    """The graph, topics with their hashes, and services."""
    wait_until(lambda: {"sim_server", "agent_0", "agent_1"} <= nodes(), "the nodes")
    clock = Topic("/clock", "rosgraph_msgs/msg/Clock")
    progress = LatchedTopic("/sim/progress", "maes_msgs/msg/Progress")
    scenario = LatchedTopic("/sim/scenario", "maes_msgs/msg/Scenario")
    equal(clock.type_hash, CLOCK_HASH, "the hash that this package has for the clock")
    for name, topic in ("/clock", clock), ("/sim/progress", progress), ("/sim/scenario", scenario):
        of_server = [info for info in publishers(name) if info.node_name == "sim_server"]
        equal([info.type_hash for info in of_server], [topic.type_hash], f"publishers of {name}")
    check(publishers("/agent_1/command"), "agents publish commands")
    equal(scenario.next().agents, 2, "agents of the scenario, which was sent before this node was there")

    set_simulation_state = Service("set_simulation_state", "SetSimulationState")
    step = Service("step_simulation", "StepSimulation")
    states = Service("get_entities_states", "GetEntitiesStates")
    step.call(steps=50)
    while (now_ns := time_ns(clock.next().clock)) < 50 * TICK_NS:
        check(now_ns % TICK_NS == 0, f"a time between ticks: {now_ns}")
    equal(now_ns, 50 * TICK_NS, "the time after 50 steps")
    everything = message(
        "simulation_interfaces/msg/EntityFilters",
        filter="",
        categories=[],
        tags=message("simulation_interfaces/msg/TagsFilter", tags=[], filter_mode=0),
        bounds=message("simulation_interfaces/msg/Bounds", type=0, points=[]),
    )
    answer = states.call(filters=everything)
    equal(list(answer.entities), ["agent_0", "agent_1"], "entities")
    equal({time_ns(state.header.stamp) for state in answer.states}, {50 * TICK_NS}, "stamps of their states")
    set_state(set_simulation_state, PLAYING)
    while progress.next().tick < 500:
        pass
    set_state(set_simulation_state, PAUSED)
    set_state(set_simulation_state, PLAYING)


class Caller:
    """A client of services whose types the package does not know: those of actions."""

    def __init__(self):
        self.session = ZenohSession.get_instance(**ROUTER).session
        self.domain = os.environ["ROS_DOMAIN_ID"]
        self.calls = 0

    def key(self, name):
        """The key expression of an endpoint of the server, by its token."""
        mangled = name.replace("/", "%")
        replies = self.session.liveliness().get(f"@ros2_lv/{self.domain}/*/*/*/*/%/%/sim_server/{mangled}/**")
        tokens = [str(reply.ok.key_expr).split("/") for reply in replies if reply.ok]
        equal(len(tokens), 1, f"tokens of {name}")
        return f"{self.domain}{name}/{tokens[0][10]}/{tokens[0][11]}"

    def call(self, name, request):
        """The handler of the replies to a request, both as CDR after the header."""
        self.calls += 1
        attachment = struct.pack("<qqB16s", self.calls, time.time_ns(), 16, bytes(range(16)))
        return self.session.get(
            self.key(name), payload=HEADER + request, attachment=attachment, timeout=600.0
        )

    def answer(self, replies):
        answers = [reply.ok for reply in replies]
        equal(len(answers), 1, "answers")
        sequence, _, _, gid = struct.unpack("<qqB16s", answers[0].attachment.to_bytes())
        check(0 < sequence <= self.calls and gid == bytes(range(16)), "an answer has the number and the id of its request")
        return answers[0].payload.to_bytes()[4:]


def action():
    """Steps by the action: a goal, its feedback and its result, a goal that is cancelled. Ends the run."""
    wait_until(lambda: {"sim_server", "agent_0", "agent_1"} <= nodes(), "the nodes")
    name = "/sim_server/simulate_steps/_action"
    caller = Caller()
    feedback = queue.Queue()
    subscriber = caller.session.declare_subscriber(caller.key(f"{name}/feedback"), feedback.put)
    first, second = bytes([1] * 16), bytes([2] * 16)

    def send(goal, steps):
        return caller.answer(caller.call(f"{name}/send_goal", goal + struct.pack("<Q", steps)))[0]

    def result(goal):
        answer = caller.answer(caller.call(f"{name}/get_result", goal))
        return answer[0], answer[1]

    check(send(first, 25), "the goal is accepted")
    equal(result(first), (SUCCEEDED, OK), "the result of the first goal")
    received = [feedback.get().payload.to_bytes()[4:] for _ in range(25)]
    steps = [struct.unpack("<QQ", message[16:]) for message in received]
    equal(steps, [(done, 25 - done) for done in range(1, 26)], "feedback")
    check(all(message[:16] == first for message in received), "feedback names its goal")
    check(not send(first, 25), "the same goal is rejected")
    # What it would receive from now on is too much for it.
    subscriber.undeclare()

    check(send(second, 1_000_000), "the second goal is accepted")
    waiting = caller.call(f"{name}/get_result", second)
    cancelled = caller.answer(caller.call(f"{name}/cancel_goal", second + bytes(8)))
    equal(cancelled[0], 0, "the code of the cancellation")
    equal(caller.answer(waiting)[0], CANCELLED, "the result of the second goal")
    set_state(Service("set_simulation_state", "SetSimulationState"), QUITTING)


SCENES = {"action": action, "whole": whole}

if __name__ == "__main__":
    folder = Path(tempfile.mkdtemp())
    try:
        definitions(folder)
        message_registry.get_registry(str(folder))
        SCENES[sys.argv[2]]()
        print("done", flush=True)
    finally:
        shutil.rmtree(folder)
        # Its threads would keep the process.
        ZenohSession.get_instance(**ROUTER).close()
