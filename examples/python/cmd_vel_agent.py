#!/usr/bin/env python3
"""An agent that speaks standard messages only: LiDAR and odometry in, velocity out.

    eval "$(launch_scripts/ros_env.sh)"
    python examples/python/cmd_vel_agent.py 0 &
    maes run --agents 2 --duration 300 --set 'agents.cmd_vel=[0]'

It flies straight on until a wall comes near, and then turns to the direction with most room. For
each stamp on /clock it replies once, with that stamp, when it has the odometry of that stamp, and in
every tenth tick (lidar.period_ticks) the scan of that stamp as well: so its decisions depend on its
sensors, and on nothing else.
"""

import math
import random
import struct
import sys

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2

TICK_NS = 20_000_000
SCAN_TICKS = 10
SPEED_M_S = 1.5
TURN_RATE_RAD_S = 1.0
NEAR_M = 2.5  # distance up to which walls are in the way
BESIDE_M = 0.45  # lateral distance from the line of flight up to which they are; the body has 0.4 m
DIRECTIONS = 20


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def points_of(cloud):
    """The points of a cloud: (x, y, z) in metres, in the frame of the body."""
    return [struct.unpack_from("<fff", cloud.data, at) for at in range(0, len(cloud.data), cloud.point_step)]


class Agent:
    def __init__(self, number):
        self.number = number
        self.rng = random.Random(number)
        self.clock = None  # the last stamp of the clock
        self.odom = {}  # odometry without a reply yet, by stamp
        self.points = {}  # the same for scans
        self.scan = []  # the last one
        self.turn_until = 0
        self.rate_rad_s = 0.0
        self.pitch_rad = 0.0
        self.answer = None  # the last reply, for retransmission
        self.answered = None  # its stamp
        node = self.node = rclpy.create_node(f"cmd_vel_agent_{number}")
        own = f"/agent_{number}"
        self.cmd_vel = node.create_publisher(TwistStamped, f"{own}/cmd_vel", QoSProfile(depth=10))
        node.create_subscription(Clock, "/clock", self.on_clock, QoSProfile(depth=10))
        node.create_subscription(Odometry, f"{own}/odom", self.on_odom, QoSProfile(depth=10))
        node.create_subscription(PointCloud2, f"{own}/points", self.on_points, qos_profile_sensor_data)

    def on_clock(self, message):
        self.clock = ns(message.clock)
        if self.clock == self.answered:
            self.cmd_vel.publish(self.answer)
        self.answer_in_time()

    def on_odom(self, message):
        self.odom[ns(message.header.stamp)] = message
        self.answer_in_time()

    def on_points(self, message):
        self.points[ns(message.header.stamp)] = message
        self.answer_in_time()

    def answer_in_time(self):
        now = self.clock
        if now is None or now == self.answered or now not in self.odom:
            return
        if now not in self.points and now // TICK_NS % SCAN_TICKS == 0:
            return
        if now in self.points:
            self.scan = points_of(self.points[now])
        self.answer = TwistStamped()
        self.answer.header.stamp = self.odom[now].header.stamp
        self.answer.header.frame_id = f"agent_{self.number}/base_link"
        self.decide(now, self.answer.twist)
        self.odom = {stamp: message for stamp, message in self.odom.items() if stamp > now}
        self.points = {stamp: message for stamp, message in self.points.items() if stamp > now}
        self.answered = now
        self.cmd_vel.publish(self.answer)

    def decide(self, now, twist):
        """Fills in the velocity in the frame of the body: x forward, y left, z up."""
        if now < self.turn_until:
            twist.angular.z = self.rate_rad_s
        elif now > self.turn_until and not self.is_blocked():
            twist.linear.x = SPEED_M_S * math.cos(self.pitch_rad)
            twist.linear.z = SPEED_M_S * math.sin(self.pitch_rad)
        elif self.scan:
            # The direction with most room, among some at random.
            x, y, z = max(self.rng.choices(self.scan, k=DIRECTIONS), key=lambda point: math.hypot(*point))
            self.pitch_rad = math.atan2(z, math.hypot(x, y))
            angle_rad = math.atan2(y, x)
            self.rate_rad_s = twist.angular.z = math.copysign(TURN_RATE_RAD_S, angle_rad)
            self.turn_until = now + int(abs(angle_rad) / TURN_RATE_RAD_S * 1e9)

    def is_blocked(self):
        """Whether a wall is near, in the direction of flight."""
        along_x, along_z = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        for x, y, z in self.scan:
            ahead = x * along_x + z * along_z
            if 0.0 < ahead < NEAR_M and math.hypot(y, z * along_x - x * along_z) < BESIDE_M:
                return True
        return False


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: cmd_vel_agent.py NUMBER")
    rclpy.init()
    agent = Agent(int(sys.argv[1]))
    # These messages have no end of a run: it is over when the topics fall silent.
    try:
        rclpy.spin(agent.node)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
