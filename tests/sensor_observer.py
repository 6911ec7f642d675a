"""A ROS 2 node that compares what sensors measure with the walls of `/sim/map`, by `/tf` alone.

    sensor_observer.py rings LOWEST_DEG HIGHEST_DEG LINES   a ring LiDAR: scans, and the fields of points
    sensor_observer.py camera RANGE_M                       a depth camera: depth images and camera infos
    sensor_observer.py batteries                            the states of batteries

Several of them, each after `+`, are observed together; `rings@NAME` and `camera@NAME` are those of a name.

Needs rclpy (see launch_scripts/ros_env.sh). Prints `ready` when it has subscribed, and `received
everything` once enough messages of agent 0 agree with the map. The map comes in pieces, and what
does not agree with those so far is compared again when there are more. A message that is wrong
whatever the map is ends it with exit code 1.
"""

import math
import sys
import time

import numpy as np
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, CameraInfo, Image, LaserScan, PointCloud2, PointField
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(depth=256, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MESSAGES = 4
# A ray that grazes an edge may pass or not, as angles have the 24 bits of a float32.
GRAZING = 0.02


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def stamp(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def matrix(transform):
    """The homogeneous matrix of a transform."""
    q, t = transform.rotation, transform.translation
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


class World:
    """The walls and the frames that have arrived so far."""

    def __init__(self, node):
        self.walls, self.cell_m = set(), None
        self.fixed, self.bodies = {}, {}
        node.create_subscription(Marker, "/sim/map", self.add_walls, LATCHED)
        node.create_subscription(TFMessage, "/tf", self.add_bodies, RELIABLE)
        node.create_subscription(TFMessage, "/tf_static", self.add_fixed, LATCHED)

    def add_walls(self, marker):
        # A piece without walls is deleted.
        if not marker.points:
            return
        self.cell_m = marker.scale.x
        self.walls |= {tuple(int(along // self.cell_m) for along in (at.x, at.y, at.z)) for at in marker.points}

    def add_bodies(self, message):
        for at in message.transforms:
            self.bodies[at.child_frame_id, stamp(at)] = matrix(at.transform)

    def add_fixed(self, message):
        for at in message.transforms:
            self.fixed[at.child_frame_id] = (at.header.frame_id, matrix(at.transform))

    def covered(self, messages):
        """The first messages among those since the subscription to the transforms was known, and not after the last."""
        known_ns = [at_ns for frame, at_ns in self.bodies if frame == "agent_0/base_link"]
        if not known_ns:
            return []
        first_ns, last_ns = min(known_ns), max(known_ns)
        return [message for message in messages if first_ns <= stamp(message) <= last_ns][:MESSAGES]

    def in_map(self, frame, at_ns):
        """From a frame to the map; the transform of the body has come before."""
        found = np.eye(4)
        while frame in self.fixed:
            frame, step = self.fixed[frame]
            found = step @ found
        check((frame, at_ns) in self.bodies, f"no transform of {frame} before the message of {at_ns} ns")
        return self.bodies[frame, at_ns] @ found

    def distance_m(self, origin, direction, limit_m):
        """The distance of the first wall on a ray, found cell by cell, and its face's axis; None beyond a limit."""
        at = [along / self.cell_m for along in origin]
        cell = [math.floor(along) for along in at]
        steps = [1 if along >= 0 else -1 for along in direction]
        apart = [1 / abs(along) if along else math.inf for along in direction]
        ahead = [cell[axis] + (steps[axis] > 0) for axis in range(3)]
        following = [
            (ahead[axis] - at[axis]) / direction[axis] if direction[axis] else math.inf for axis in range(3)
        ]
        while True:
            axis = following.index(min(following))
            distance_m = following[axis] * self.cell_m
            if distance_m > limit_m:
                return None
            cell[axis] += steps[axis]
            following[axis] += apart[axis]
            if tuple(cell) in self.walls:
                return distance_m, axis


def agrees(measured, found):
    """Whether a distance is the one that was found, and both or none are beyond the range."""
    if math.isinf(measured) or found is None:
        return measured == math.inf and found is None
    return abs(measured - found[0]) < 2e-3


def is_enough(results):
    return sum(results) >= len(results) * (1.0 - GRAZING)


class Rings:
    """A level or tilted ring LiDAR with an odd number of lines, of which the middle one is in its plane."""

    def __init__(self, node, world, name, arguments):
        self.world, self.frame = world, f"agent_0/{name or 'lidar'}"
        topics = f"/agent_0/{name}" if name else "/agent_0"
        self.lowest_deg, self.highest_deg, self.lines = float(arguments[0]), float(arguments[1]), int(arguments[2])
        self.scans, self.clouds = [], []
        node.create_subscription(LaserScan, f"{topics}/scan", self.scans.append, qos_profile_sensor_data)
        node.create_subscription(PointCloud2, f"{topics}/points", self.clouds.append, qos_profile_sensor_data)

    def agree(self):
        scans, clouds = self.world.covered(self.scans), self.world.covered(self.clouds)
        if len(scans) < MESSAGES or len(clouds) < MESSAGES:
            return False
        return all(map(self.is_true_scan, scans)) and all(map(self.is_true_cloud, clouds))

    def is_true_scan(self, scan):
        check(scan.header.frame_id == self.frame, f"frame of a scan: {scan.header.frame_id}")
        steps = (scan.angle_max - scan.angle_min) / scan.angle_increment
        check(abs(steps + 1 - len(scan.ranges)) < 1e-2, f"{len(scan.ranges)} ranges for {steps} steps")
        check(scan.time_increment == 0.0 and scan.scan_time > 0.0, f"times of a scan: {scan.scan_time}")
        check(not any(math.isnan(measured) for measured in scan.ranges), "no return is missed")
        valid = [measured for measured in scan.ranges if math.isfinite(measured)]
        check(valid and min(valid) >= scan.range_min and max(valid) <= scan.range_max, "ranges are within their bounds")
        in_map = self.world.in_map(scan.header.frame_id, stamp(scan))
        results = []
        for number, measured in enumerate(scan.ranges):
            angle = scan.angle_min + number * scan.angle_increment
            direction = in_map[:3, :3] @ (math.cos(angle), math.sin(angle), 0.0)
            results.append(agrees(measured, self.world.distance_m(in_map[:3, 3], direction, scan.range_max + 1e-3)))
        return is_enough(results)

    def is_true_cloud(self, cloud):
        layout = [(field.name, field.offset, field.datatype) for field in cloud.fields]
        single, short = PointField.FLOAT32, PointField.UINT16
        expected = [("x", 0, single), ("y", 4, single), ("z", 8, single)]
        expected += [("intensity", 12, single), ("ring", 16, short), ("time", 18, single)]
        check(layout == expected and cloud.point_step == 22, f"fields of points: {layout}")
        kinds = [(name, "<f4" if kind == single else "<u2") for name, _, kind in layout]
        points = np.frombuffer(bytes(cloud.data), dtype=kinds)
        check(len(points) == cloud.width > 100 and not points["time"].any(), "a scan takes no time")
        check(len(set(points["ring"])) == self.lines, f"rings of points: {sorted(set(points['ring']))}")
        in_map = self.world.in_map(cloud.header.frame_id, stamp(cloud))
        lidar = self.world.in_map(self.frame, stamp(cloud))
        results = []
        for x, y, z, intensity, ring, _ in points.tolist():
            at = (in_map @ (x, y, z, 1.0))[:3]
            way = at - lidar[:3, 3]
            right, left, up = lidar[:3, :3].T @ way
            elevation_deg = math.degrees(math.atan2(up, math.hypot(right, left)))
            step_deg = (self.highest_deg - self.lowest_deg) / (self.lines - 1)
            of_ring_deg = self.lowest_deg + ring * step_deg
            check(abs(elevation_deg - of_ring_deg) < 0.02, f"ring {ring} at {elevation_deg} degrees")
            length = np.linalg.norm(way)
            found = self.world.distance_m(lidar[:3, 3], way / length, length + 1e-2)
            is_true = agrees(length, found)
            results.append(is_true and abs(intensity - 100.0 * abs(way[found[1]]) / length) < 0.05)
        return is_enough(results)


class Camera:
    """A depth camera."""

    def __init__(self, node, world, name, arguments):
        self.world, self.range_m = world, float(arguments[0])
        self.frame = f"agent_0/{name or 'camera'}_optical_frame"
        topics = f"/agent_0/{name}/depth" if name else "/agent_0/depth"
        self.images, self.infos = {}, {}
        node.create_subscription(Image, f"{topics}/image", self.add_to(self.images), qos_profile_sensor_data)
        node.create_subscription(CameraInfo, f"{topics}/camera_info", self.add_to(self.infos), qos_profile_sensor_data)

    def add_to(self, messages):
        return lambda message: messages.setdefault(stamp(message), message)

    def agree(self):
        pairs = sorted(self.images.keys() & self.infos.keys())
        images = self.world.covered([self.images[at_ns] for at_ns in pairs])
        return len(images) == MESSAGES and all(self.is_true(image, self.infos[stamp(image)]) for image in images)

    def is_true(self, image, info):
        frame = self.frame
        check(image.header.frame_id == info.header.frame_id == frame, f"frame of an image: {image.header.frame_id}")
        check((image.encoding, image.step) == ("32FC1", 4 * image.width), f"{image.encoding}, {image.step}")
        check((image.width, image.height) == (info.width, info.height), "the info is that of the image")
        check(info.distortion_model == "plumb_bob" and not any(info.d), "there is no distortion")
        check(list(info.p[:3]) == list(info.k[:3]) and list(info.r) == list(np.eye(3).ravel()), "the image is rectified")
        fx, cx, fy, cy = info.k[0], info.k[2], info.k[4], info.k[5]
        depths_m = np.frombuffer(bytes(image.data), dtype="<f4").reshape(image.height, image.width)
        in_map = self.world.in_map(frame, stamp(image))
        results = []
        for (v, u), depth_m in np.ndenumerate(depths_m):
            ray = np.array([(u - cx) / fx, (v - cy) / fy, 1.0])
            length = np.linalg.norm(ray)
            found = self.world.distance_m(in_map[:3, 3], in_map[:3, :3] @ ray / length, self.range_m)
            results.append(agrees(float(depth_m) * length, found))
        return is_enough(results) and bool(np.isfinite(depths_m).any())


class Batteries:
    """A battery that is drained, and charged in a base."""

    def __init__(self, node, _world, _name, _arguments):
        self.states = []
        node.create_subscription(BatteryState, "/agent_0/battery_state", self.states.append, RELIABLE)

    def agree(self):
        for state in self.states:
            check(state.present and 0.0 <= state.percentage <= 1.0, f"percentage {state.percentage}")
            unknown = (state.voltage, state.temperature, state.current, state.charge, state.capacity)
            check(all(map(math.isnan, unknown + (state.design_capacity,))), f"{unknown} are not known")
        drains = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        pairs = zip(self.states, self.states[1:])
        away = [(one, other) for one, other in pairs if one.power_supply_status == other.power_supply_status == drains]
        check(all(one.percentage >= other.percentage for one, other in away), "energy does not rise away from a base")
        kinds = {state.power_supply_status for state in self.states}
        return {BatteryState.POWER_SUPPLY_STATUS_CHARGING, drains} <= kinds and len(away) >= MESSAGES


def main():
    kinds = {"rings": Rings, "camera": Camera, "batteries": Batteries}
    rclpy.init()
    node = rclpy.create_node("sensor_observer")
    world = World(node)
    sensors = []
    for words in " ".join(sys.argv[1:]).split("+"):
        kind, *arguments = words.split()
        kind, _, name = kind.partition("@")
        sensors.append(kinds[kind](node, world, name, arguments))
    print("ready", flush=True)
    compared = time.monotonic()
    while True:
        rclpy.spin_once(node, timeout_sec=0.2)
        if time.monotonic() - compared > 1.0:
            if all(sensor.agree() for sensor in sensors):
                break
            compared = time.monotonic()
    print("received everything", flush=True)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
