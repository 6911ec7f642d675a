"""Gives the agent of cmd_vel_agent.py its first messages in every order: it has to reply once.

    cmd_vel_orders.py FOLDER_OF_THE_EXAMPLES
"""

import itertools
import sys

sys.path.insert(0, sys.argv[1])

import rclpy  # noqa: E402
from builtin_interfaces.msg import Time  # noqa: E402
from cmd_vel_agent import SCAN_TICKS, TICK_NS, Agent  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402


def messages(agent, tick):
    """What arrives in a tick: (callback, message)."""
    stamp = Time(nanosec=tick * TICK_NS)
    odom, points = Odometry(), PointCloud2(point_step=12)
    odom.header.stamp = points.header.stamp = stamp
    arriving = [(agent.on_clock, Clock(clock=stamp)), (agent.on_odom, odom)]
    return arriving + [(agent.on_points, points)] * (tick % SCAN_TICKS == 0)


def replies(first, second):
    """The stamps of the replies to messages of ticks 0 and 1 in these orders."""
    agent = Agent(0)
    sent = []
    agent.cmd_vel.publish = lambda reply: sent.append(reply.header.stamp.nanosec)
    for tick, order in enumerate([first, second]):
        arriving = messages(agent, tick)
        for i in order:
            callback, message = arriving[i]
            callback(message)
    agent.node.destroy_node()
    return sent


rclpy.init()
for first, second in itertools.product(itertools.permutations(range(3)), itertools.permutations(range(2))):
    assert replies(first, second) == [0, TICK_NS], (first, second)
rclpy.shutdown()
