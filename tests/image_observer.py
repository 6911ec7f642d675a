"""A ROS 2 node beside containers: it starts their run, which is paused, and observes it to its end.

    image_observer.py

Needs rclpy, maes_msgs and simulation_interfaces (see launch_scripts/ros_env.sh). Fails unless it
receives the scenario, the clock, transforms of all agents and the result; prints the latter.
"""

import sys

import rclpy
from maes_msgs.msg import Result, Scenario
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from simulation_interfaces.msg import SimulationState
from simulation_interfaces.srv import SetSimulationState
from tf2_msgs.msg import TFMessage

AGENTS = 5
PATIENCE_S = 300.0
RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

rclpy.init()
node = rclpy.create_node("image_observer")
received = {"/sim/scenario": [], "/clock": [], "/tf": [], "/sim/result": []}
for topic, kind, qos in (
    ("/sim/scenario", Scenario, LATCHED),
    ("/clock", Clock, RELIABLE),
    ("/tf", TFMessage, RELIABLE),
    ("/sim/result", Result, LATCHED),
):
    node.create_subscription(kind, topic, received[topic].append, qos)

state = node.create_client(SetSimulationState, "/sim_server/set_simulation_state")
if not state.wait_for_service(PATIENCE_S):
    sys.exit("no service of the server")
request = SetSimulationState.Request(state=SimulationState(state=SimulationState.STATE_PLAYING))
answer = state.call_async(request)
rclpy.spin_until_future_complete(node, answer, timeout_sec=PATIENCE_S)
if not answer.done() or answer.result().result.result != 1:
    sys.exit(f"the run does not start: {answer.result() if answer.done() else 'no answer'}")

deadline = node.get_clock().now().nanoseconds + int(PATIENCE_S * 1e9)
while not received["/sim/result"]:
    if node.get_clock().now().nanoseconds > deadline:
        sys.exit("no result")
    rclpy.spin_once(node, timeout_sec=1.0)
frames = {one.child_frame_id for tf in received["/tf"] for one in tf.transforms}
missing = {f"agent_{agent}/base_link" for agent in range(AGENTS)} - frames
missing |= {topic for topic, messages in received.items() if not messages}
if missing:
    sys.exit(f"not received: {sorted(missing)}")
(result,) = received["/sim/result"]
print(f"observed to {result.reason} at tick {result.tick}")
