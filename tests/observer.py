"""A ROS 2 node that observes a run: checks its nodes, topics and public messages with the stock
types.

    observer.py [--agents N] [--size S] [--look-ahead] [--then forever|result]

Needs rclpy and maes_msgs (see launch_scripts/ros_env.sh). Prints `ready` when it has subscribed,
and `received everything` when all checks have passed; then it ends, or stays for ever, or until
it has the result of the run and prints `result DIGEST`. With --look-ahead, agents do not get an
observation at every tick. A failure goes to stderr, with exit code 1.
"""

import argparse
import math
import struct
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from maes_msgs.msg import Digest, Progress, Result, Scenario, SignedObservation
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import String
from tf2_msgs.action import LookupTransform  # noqa: F401: tf2_ros imports it, and the next two
from tf2_msgs.msg import TF2Error, TFMessage  # noqa: F401
from tf2_msgs.srv import FrameGraph  # noqa: F401
from visualization_msgs.msg import Marker

RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SENSOR = qos_profile_sensor_data
TICK_NS = 20_000_000
TYPES = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/rosout": "rcl_interfaces/msg/Log",
    "/sim/scenario": "maes_msgs/msg/Scenario",
    "/sim/join_reply": "maes_msgs/msg/JoinReply",
    "/sim/progress": "maes_msgs/msg/Progress",
    "/sim/digest": "maes_msgs/msg/Digest",
    "/sim/result": "maes_msgs/msg/Result",
    "/sim/map": "visualization_msgs/msg/Marker",
    "/sim/unexplored": "visualization_msgs/msg/Marker",
    "/sim/contacts": "visualization_msgs/msg/Marker",
    "/sim/info": "diagnostic_msgs/msg/DiagnosticArray",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/robot_description": "std_msgs/msg/String",
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/sim/map_points": "sensor_msgs/msg/PointCloud2",
    "/sim/octomap": "octomap_msgs/msg/Octomap",
    "/sim/explored_octomap": "octomap_msgs/msg/Octomap",
    "/sim/explored_map": "nav_msgs/msg/OccupancyGrid",
    "/sim/explored_points": "sensor_msgs/msg/PointCloud2",
    "/agent_0/observation": "maes_msgs/msg/SignedObservation",
    "/agent_0/command": "maes_msgs/msg/SignedCommand",
    "/agent_0/join": "maes_msgs/msg/SignedJoin",
    "/agent_0/odom": "nav_msgs/msg/Odometry",
    "/agent_0/points": "sensor_msgs/msg/PointCloud2",
    "/agent_0/path": "nav_msgs/msg/Path",
    "/agent_0/map": "visualization_msgs/msg/Marker",
}
# Subscriptions, and how many messages of each are required.
SUBSCRIPTIONS = {
    "/clock": (Clock, RELIABLE, 50),
    "/tf": (TFMessage, RELIABLE, 10),
    "/tf_static": (TFMessage, LATCHED, 1),
    "/rosout": (Log, LATCHED, 2),
    "/sim/scenario": (Scenario, LATCHED, 1),
    "/sim/progress": (Progress, LATCHED, 1),
    "/sim/digest": (Digest, RELIABLE, 2),
    "/sim/map": (Marker, LATCHED, 1),
    "/sim/unexplored": (Marker, LATCHED, 1),
    "/sim/contacts": (Marker, LATCHED, 1),
    "/sim/info": (DiagnosticArray, RELIABLE, 2),
    "/diagnostics": (DiagnosticArray, RELIABLE, 2),
    "/robot_description": (String, LATCHED, 1),
    "/map": (OccupancyGrid, LATCHED, 1),
    "/sim/map_points": (PointCloud2, LATCHED, 1),
    "/sim/explored_map": (OccupancyGrid, LATCHED, 1),
    "/sim/explored_points": (PointCloud2, LATCHED, 1),
    "/sim/result": (Result, LATCHED, 0),
    "/agent_0/observation": (SignedObservation, RELIABLE, 20),
    "/agent_0/odom": (Odometry, RELIABLE, 10),
    "/agent_0/points": (PointCloud2, SENSOR, 3),
    "/agent_0/path": (Path, LATCHED, 1),
    "/agent_0/map": (Marker, LATCHED, 3),
}


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def nanoseconds(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class Observer:
    def __init__(self, node, arguments):
        self.node = node
        self.agents = arguments.agents
        self.size = arguments.size
        self.type_hashes = arguments.type_hashes
        self.wanted = {topic: count for topic, (_, _, count) in SUBSCRIPTIONS.items()}
        if arguments.look_ahead:
            self.wanted["/agent_0/observation"] = 1
        self.received = {topic: [] for topic in SUBSCRIPTIONS}
        for topic, (kind, qos, _) in SUBSCRIPTIONS.items():
            node.create_subscription(kind, topic, lambda message, topic=topic: self.receive(topic, message), qos)

    def receive(self, topic, message):
        # An observer that stays for ever keeps a bounded number.
        if len(self.received[topic]) < 2000:
            self.received[topic].append(message)

    def missing(self):
        """Missing messages by topic."""
        left = {topic: count - len(self.received[topic]) for topic, count in self.wanted.items()}
        return {topic: count for topic, count in left.items() if count > 0}

    def unseen(self):
        """What is missing in the graph: nodes, topics, and topics without a publisher whose node is known."""
        nodes = {(name, "/") for name in ["sim_server"] + [f"agent_{agent}" for agent in range(self.agents)]}
        topics = dict(self.node.get_topic_names_and_types())
        missing = sorted(nodes - set(self.node.get_node_names_and_namespaces())) + sorted(TYPES.keys() - topics.keys())
        return missing or [topic for topic in SUBSCRIPTIONS if not self.offers(topic)]

    def offers(self, topic):
        """The publishers of the run's nodes."""
        ours = {"sim_server"} | {f"agent_{agent}" for agent in range(self.agents)}
        return [end for end in self.node.get_publishers_info_by_topic(topic) if end.node_name in ours]

    def unlogged(self):
        """Who has not written to /rosout yet, of the server and the agents."""
        names = {log.name for log in self.received["/rosout"]}
        agents = any(name.startswith("agent_") for name in names)
        return sorted({"sim_server"} - names) + ([] if agents else ["any agent"])

    def has_received_everything(self):
        return not self.missing() and not self.unlogged() and not self.unseen()

    def check(self):
        self.check_graph()
        self.check_protocol()
        self.check_frames()
        self.check_texts()
        self.check_markers()
        self.check_points()

    def check_graph(self):
        topics = dict(self.node.get_topic_names_and_types())
        for topic, kind in TYPES.items():
            check(topics[topic] == [kind], f"{topic} has the types {topics[topic]}")
        for topic, (_, qos, _) in SUBSCRIPTIONS.items():
            offers = self.offers(topic)
            for offer in offers:
                offered = offer.qos_profile
                check(offered.reliability == qos.reliability, f"{topic} is {offered.reliability}")
                check(offered.durability == qos.durability, f"{topic} is {offered.durability}")
            if self.type_hashes:
                # That of this node is made by the middleware.
                name = self.node.get_name()
                own = [end for end in self.node.get_subscriptions_info_by_topic(topic) if end.node_name == name]
                hashes = {str(end.topic_type_hash) for end in offers + own}
                check(len(hashes) == 1 and "RIHS01_" in hashes.pop(), f"{topic} has the type hashes {hashes}")

    def check_protocol(self):
        times_ns = [nanoseconds(clock.clock) for clock in self.received["/clock"]]
        check(times_ns == sorted(set(times_ns)), "the clock runs forwards")
        check(all(time_ns % TICK_NS == 0 for time_ns in times_ns), "the clock shows fixed updates")
        scenario = self.received["/sim/scenario"][0]
        expected = ([self.size] * 3, self.agents, TICK_NS)
        check((list(scenario.size), scenario.agents, scenario.tick_ns) == expected, f"{scenario}")
        observations = [signed.observation for signed in self.received["/agent_0/observation"]]
        ticks = [observation.tick for observation in observations]
        check(ticks == sorted(ticks), "observations come in order")
        check(all(observation.agent == 0 for observation in observations), "observations are of agent 0")
        check(0.0 < observations[-1].position.x < self.size, f"the agent is in the map: {observations[-1].position}")
        check(0.0 <= self.received["/sim/progress"][0].explored <= 1.0, "progress is a fraction")
        check(all(digest.tick % 50 == 0 for digest in self.received["/sim/digest"]), "digests are of whole seconds")

    def check_frames(self):
        fixed = {(at.header.frame_id, at.child_frame_id) for message in self.received["/tf_static"] for at in message.transforms}
        bodies = {(f"agent_{agent}/base_link", f"agent_{agent}/lidar") for agent in range(self.agents)}
        check(fixed == bodies | {("map", f"agent_{agent}/odom") for agent in range(self.agents)}, f"{fixed}")
        moving = {f"agent_{agent}/base_link" for agent in range(self.agents)}
        transforms = [at for message in self.received["/tf"] for at in message.transforms]
        check({at.child_frame_id for at in transforms} == moving, "every agent has a frame")
        check(all(at.header.frame_id == "map" for at in transforms), "frames are in the map")
        stamps = [(at.child_frame_id, nanoseconds(at.header.stamp)) for at in transforms]
        # A new subscriber gets the present ones again.
        check(len(stamps) - len(set(stamps)) <= 4 * self.agents, "no transform comes twice")
        here = [stamp for frame, stamp in stamps if frame == "agent_0/base_link"]
        for name in ("odom", "points"):
            wanted = {nanoseconds(message.header.stamp) for message in self.received[f"/agent_0/{name}"]}
            # Subscriptions become known one after another, and are read one after another.
            missing = {stamp for stamp in wanted - set(here) if min(here) < stamp < max(here)}
            check(not missing, f"there are transforms at the stamps of {name}, but not at {missing} ns")
        stamps = [nanoseconds(message.header.stamp) for message in self.received["/agent_0/odom"]]
        check(stamps == sorted(set(stamps)), "odometry goes forwards")
        # A new subscriber gets a message at once; the others follow the period.
        unexpected = [stamp for stamp in stamps if stamp % (5 * TICK_NS) != 0]
        check(len(unexpected) <= 4, f"odometry comes every 5 ticks, but at {unexpected} ns")
        for odometry in self.received["/agent_0/odom"]:
            check((odometry.header.frame_id, odometry.child_frame_id) == ("map", "agent_0/base_link"), "frames of odometry")
            check(abs(odometry.twist.twist.linear.y) < 1e-9, "the twist is in the frame of the body, which cannot go sideways")
        for path in self.received["/agent_0/path"]:
            check(path.header.frame_id == "map", "a path is in the map")
            check(all(0.0 < pose.pose.position.x < self.size for pose in path.poses), "a path stays in the map")

    def check_texts(self):
        for info in self.received["/sim/info"]:
            names = [status.name for status in info.status]
            check(names == ["run", "loop"] + [f"agent_{agent}" for agent in range(self.agents)], f"{names}")
            values = {value.key: value.value for value in info.status[0].values}
            check(0.0 <= float(values["explored"]) <= 1.0 and float(values["rtf"]) > 0.0, f"{values}")
        wholes = [sum(float(value.value) for value in info.status[1].values) for info in self.received["/sim/info"]]
        check(max(wholes) > 0.0, f"wall time by phase: {wholes}")
        logs = {(log.name, log.level) for log in self.received["/rosout"] if log.name != self.node.get_name()}
        check(("sim_server", Log.INFO) in logs, f"{logs}")

    def check_markers(self):
        self.walls = self.cells("/sim/map", {"walls"})
        unexplored = self.cells("/sim/unexplored", {"unexplored"})
        check(self.walls and not self.walls & unexplored, "unexplored cells are free")
        believed = self.cells("/agent_0/map", {"walls", "free", "frontiers"})
        check(believed, "an agent has a map")
        for lines in self.received["/sim/contacts"]:
            check(lines.type == Marker.LINE_LIST and len(lines.points) % 2 == 0, "contacts are lines")
            check((lines.action == Marker.DELETE) == (not lines.points), "without contacts there are no lines")

    def cells(self, topic, groups):
        """The cells of all markers of a topic, checked."""
        found = set()
        for marker in self.received[topic]:
            check(marker.ns in groups and marker.type == Marker.CUBE_LIST, f"{topic}: {marker.ns}, {marker.type}")
            check(marker.header.frame_id == "map" and marker.pose.orientation.w == 1.0, f"{topic} is in the map")
            check((marker.action == Marker.DELETE) == (not marker.points), f"{topic}: a marker without points is deleted")
            found |= {(math.floor(at.x), math.floor(at.y), math.floor(at.z)) for at in marker.points}
        check(all(0 <= along < self.size for cell in found for along in cell), f"{topic} stays in the map")
        return found

    def check_points(self):
        """Points lie on walls, from the pose of the agent at the tick of the scan."""
        poses = {signed.observation.tick: signed.observation for signed in self.received["/agent_0/observation"]}
        compared = 0
        for cloud in self.received["/agent_0/points"]:
            check(cloud.header.frame_id == "agent_0/base_link", f"frame of points: {cloud.header.frame_id}")
            check([field.name for field in cloud.fields] == ["x", "y", "z"], "fields of points")
            check(all(field.datatype == PointField.FLOAT32 for field in cloud.fields), "points are float32")
            check(len(cloud.data) == cloud.row_step == cloud.width * 12 > 0, "length of points")
            at = poses.get(nanoseconds(cloud.header.stamp) // TICK_NS)
            if at is None:
                continue
            compared += 1
            sin, cos = math.sin(at.yaw_rad), math.cos(at.yaw_rad)
            missed = 0
            for x, y, z in struct.iter_unpack("<fff", bytes(cloud.data)):
                # A little beyond the surface, which is a face of the wall.
                far = 1.0 + 1e-4 / math.sqrt(x * x + y * y + z * z)
                hit = (
                    at.position.x + (cos * x - sin * y) * far,
                    at.position.y + (sin * x + cos * y) * far,
                    at.position.z + z * far,
                )
                missed += tuple(math.floor(along) for along in hit) not in self.walls
            # A ray at an edge may end in the next cell.
            check(missed <= cloud.width // 100, f"{missed} of {cloud.width} rays have not met a wall")
        check(compared > 0 or self.wanted["/agent_0/observation"] == 1, "a scan was in a tick that was observed")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--agents", type=int, default=2)
    parser.add_argument("--size", type=int, default=20)
    parser.add_argument("--look-ahead", action="store_true")
    parser.add_argument("--type-hashes", action="store_true")
    parser.add_argument("--then", choices=["forever", "result"])
    arguments = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node("observer")
    observer = Observer(node, arguments)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    print("ready", flush=True)
    printed = time.monotonic()
    while not observer.has_received_everything():
        executor.spin_once(timeout_sec=0.2)
        if time.monotonic() - printed > 10.0:
            printed = time.monotonic()
            print(f"still missing: {observer.missing()} {observer.unlogged()} {observer.unseen()}", file=sys.stderr, flush=True)
    observer.check()
    print("received everything", flush=True)
    while arguments.then == "forever" or (arguments.then == "result" and not observer.received["/sim/result"]):
        executor.spin_once(timeout_sec=0.2)
    for result in observer.received["/sim/result"]:
        print(f"result {bytes(result.digest).hex()}", flush=True)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
