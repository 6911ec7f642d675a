"""A ROS 2 node that looks on at a run: sees its nodes and topics, and receives what everybody may.

    onlooker.py [FOREVER]

Needs rclpy and maes_msgs (see launch_scripts/ros_env.sh). Says `ready` when it listens, and `seen everything` when it has; then
it ends, or goes on listening if there is an argument. What is wrong goes to stderr, with exit code 1.
"""

import sys

import rclpy
from maes_msgs.msg import Observation, Progress, Scenario
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TYPES = {
    "/clock": ["rosgraph_msgs/msg/Clock"],
    "/sim/scenario": ["maes_msgs/msg/Scenario"],
    "/sim/join_reply": ["maes_msgs/msg/JoinReply"],
    "/sim/progress": ["maes_msgs/msg/Progress"],
    "/agent_0/observation": ["maes_msgs/msg/Observation"],
    "/agent_0/command": ["maes_msgs/msg/Command"],
    "/agent_0/join": ["maes_msgs/msg/Join"],
}
NODES = {("sim_server", "/"), ("agent_0", "/"), ("agent_1", "/")}
SUBSCRIPTIONS = {
    "/clock": (Clock, RELIABLE),
    "/sim/scenario": (Scenario, LATCHED),
    "/sim/progress": (Progress, LATCHED),
    "/agent_0/observation": (Observation, RELIABLE),
}


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


class Onlooker:
    def __init__(self, node):
        self.node = node
        self.received = {topic: [] for topic in SUBSCRIPTIONS}
        for topic, (kind, qos) in SUBSCRIPTIONS.items():
            node.create_subscription(kind, topic, lambda message, topic=topic: self.receive(topic, message), qos)

    def receive(self, topic, message):
        # Enough is enough, for an onlooker that goes on for ever.
        if len(self.received[topic]) < 1000:
            self.received[topic].append(message)

    def has_seen_everything(self):
        wanted = {"/clock": 50, "/sim/scenario": 1, "/sim/progress": 1, "/agent_0/observation": 20}
        if any(len(self.received[topic]) < count for topic, count in wanted.items()):
            return False
        topics = dict(self.node.get_topic_names_and_types())
        return NODES <= set(self.node.get_node_names_and_namespaces()) and TYPES.keys() <= topics.keys()

    def check(self):
        topics = dict(self.node.get_topic_names_and_types())
        for topic, types in TYPES.items():
            check(topics[topic] == types, f"{topic} has the types {topics[topic]}")
        times_ns = [clock.clock.sec * 1_000_000_000 + clock.clock.nanosec for clock in self.received["/clock"]]
        check(times_ns == sorted(set(times_ns)), "the clock runs forwards")
        check(all(time_ns % 20_000_000 == 0 for time_ns in times_ns), "the clock shows fixed updates")
        scenario = self.received["/sim/scenario"][0]
        check((list(scenario.size), scenario.agents, scenario.tick_ns) == ([20, 20, 20], 2, 20_000_000), f"{scenario}")
        observations = self.received["/agent_0/observation"]
        ticks = [observation.tick for observation in observations]
        check(ticks == sorted(ticks), "observations come in order")
        check(all(observation.agent == 0 for observation in observations), "observations are of agent 0")
        check(0.0 < observations[-1].position.x < 20.0, f"the agent is in the map: {observations[-1].position}")
        check(0.0 <= self.received["/sim/progress"][0].explored <= 1.0, "progress is a fraction")


def main():
    rclpy.init()
    node = rclpy.create_node("onlooker")
    onlooker = Onlooker(node)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    print("ready", flush=True)
    while not onlooker.has_seen_everything():
        executor.spin_once(timeout_sec=0.2)
    onlooker.check()
    print("seen everything", flush=True)
    while len(sys.argv) > 1:
        executor.spin_once(timeout_sec=0.2)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
