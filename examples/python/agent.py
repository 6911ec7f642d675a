#!/usr/bin/env python3
"""An agent in Python: straight on until something is in the way, then a random turn.

    eval "$(launch_scripts/ros_env.sh)"
    python examples/python/agent.py 0 &
    maes run --agents 2 --duration 300 --external 0

It speaks the protocol of docs/topics.md and nothing more; its decisions are in `decide`. It does not
sign what it sends, which --external allows.
"""

import math
import random
import secrets
import sys

import rclpy
from maes_msgs.msg import (
    Command,
    Join,
    JoinReply,
    Observation,
    Scenario,
    SignedCommand,
    SignedJoin,
    SignedObservation,
    Motion,
    WakeCondition,
)
from rclpy.qos import DurabilityPolicy, QoSProfile

PROTOCOL = 7
RELIABLE = QoSProfile(depth=16)
LATCHED = QoSProfile(depth=256, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def decide(command, parts, rng):
    """Fills in the command for an observation."""
    first = parts[0]
    command.wake.at_tick = 2**64 - 1
    command.wake.events = WakeCondition.TASK_DONE
    if first.task_status == Observation.ACTIVE:
        command.motion.kind = Motion.KEEP
    elif first.collision == Observation.NONE and first.tick > 0:
        command.motion.kind = Motion.MOVE
        command.motion.pitch_rad = rng.uniform(-0.5, 0.5)
        command.motion.distance_m = math.inf
    else:
        command.motion.kind = Motion.TURN
        command.motion.angle_rad = rng.uniform(-math.pi, math.pi)


class Agent:
    def __init__(self, number):
        self.number = number
        self.instance = secrets.randbits(64)
        self.rng = None  # from the scenario
        self.run = None  # the same
        self.origin = None  # the same
        self.is_accepted = False
        self.parts = {}  # fragments of the observation that is arriving, by number
        self.answer = None  # the last command, for retransmission
        self.is_done = False
        node = self.node = rclpy.create_node(f"agent_{number}")
        self.join_topic = node.create_publisher(SignedJoin, f"/agent_{number}/join", RELIABLE)
        self.command_topic = node.create_publisher(SignedCommand, f"/agent_{number}/command", RELIABLE)
        node.create_subscription(Scenario, "/sim/scenario", self.on_scenario, LATCHED)
        node.create_subscription(JoinReply, "/sim/join_reply", self.on_reply, LATCHED)
        node.create_subscription(SignedObservation, f"/agent_{number}/observation", self.on_observation, RELIABLE)
        node.create_timer(0.2, self.join)

    def on_scenario(self, scenario):
        # Run number 0 is a replay, not a run. A reset run restarts with a higher number.
        begins = self.run is None and scenario.run != 0
        if begins or (scenario.origin == self.origin and scenario.run > self.run):
            self.run, self.origin = scenario.run, scenario.origin
            self.rng = random.Random(f"{scenario.agents_seed} {self.number}")
            self.is_accepted, self.parts, self.answer = False, {}, None

    def join(self):
        if self.rng is not None and not self.is_accepted:
            join = Join(
                run=self.run,
                agent=self.number,
                instance=self.instance,
                protocol=PROTOCOL,
                controller="example",
                last_tick=Join.NONE,
            )
            # A nonce of zeros says that the commands are not signed.
            self.join_topic.publish(SignedJoin(join=join))

    def on_reply(self, reply):
        if (reply.run, reply.agent, reply.instance) == (self.run, self.number, self.instance):
            if reply.code == JoinReply.HELD:
                return  # by a process that may have to be replaced: the join is repeated
            if not reply.accepted:
                sys.exit(f"refused: {reply.reason}")
            self.is_accepted = True

    def on_observation(self, signed):
        part = signed.observation
        if not self.is_accepted or part.run != self.run:
            return
        if part.phase == Observation.RUNNING and self.answer is not None and part.tick <= self.answer.tick:
            if part.tick == self.answer.tick and part.part + 1 == part.parts:
                self.command_topic.publish(SignedCommand(command=self.answer))
            return
        present = next(iter(self.parts.values()), part)
        if (present.tick, present.phase) != (part.tick, part.phase):
            self.parts = {}
        self.parts[part.part] = part
        if len(self.parts) < part.parts:
            return
        parts = [self.parts[number] for number in range(part.parts)]
        self.parts = {}
        self.answer = Command(tick=part.tick, run=self.run, agent=self.number)
        if part.phase == Observation.ENDED:
            self.is_done = True
        else:
            decide(self.answer, parts, self.rng)
        self.command_topic.publish(SignedCommand(command=self.answer))


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: agent.py NUMBER")
    rclpy.init()
    agent = Agent(int(sys.argv[1]))
    while not agent.is_done:
        rclpy.spin_once(agent.node)
    # Time for the acknowledgement to leave.
    rclpy.spin_once(agent.node, timeout_sec=0.3)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
