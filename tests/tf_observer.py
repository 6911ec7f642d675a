"""A ROS 2 node that prints what arrives on `/tf` and `/agent_0/points`, for tests/clients.rs.

    tf_observer.py

Needs rclpy (see launch_scripts/ros_env.sh). Prints `ready` when it has subscribed, and at the
result of the run all that has arrived, in this order and a line each: `tf STAMP PARENT CHILD X Y Z
QX QY QZ QW` for a transform, and `at STAMP FRAME` for a cloud; stamps are nanoseconds.
"""

import rclpy
from maes_msgs.msg import Result
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

# As a listener of tf2_ros.
TRANSFORMS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def stamp(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def main():
    rclpy.init()
    node = rclpy.create_node("tf_observer")
    arrived, ended = [], []

    def add_transforms(message):
        for at in message.transforms:
            place, turn = at.transform.translation, at.transform.rotation
            numbers = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
            words = ("tf", stamp(at), at.header.frame_id, at.child_frame_id, *map(repr, numbers))
            arrived.append(" ".join(map(str, words)))

    def add_cloud(message):
        arrived.append(f"at {stamp(message)} {message.header.frame_id}")

    node.create_subscription(TFMessage, "/tf", add_transforms, TRANSFORMS)
    node.create_subscription(PointCloud2, "/agent_0/points", add_cloud, qos_profile_sensor_data)
    node.create_subscription(Result, "/sim/result", ended.append, LATCHED)
    # The run begins after that; what arrives before the server knows of a subscription is not missed.
    while not all(node.count_publishers(topic) for topic in ("/tf", "/agent_0/points", "/sim/result")):
        rclpy.spin_once(node, timeout_sec=0.1)
    print("ready", flush=True)
    while not ended:
        rclpy.spin_once(node)
    print("\n".join(arrived))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
