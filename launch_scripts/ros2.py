#!/usr/bin/env python3
"""A small `ros2`, for an environment of wheels: PyPI has none of the packages of that program.

    ros2 topic list [-t] | echo NAME [--once] [--qos-durability D] | hz NAME
    ros2 node list | service list | param list NODE
    ros2 service call NAME TYPE VALUES | action send_goal NAME TYPE VALUES
    ros2 param get|describe NODE NAME | param set NODE NAME NUMBER

It has the commands of docs/ros2.md with the same arguments, by rclpy, and waits for what they name.
launch_scripts/ros_env.sh puts it into its environment; an installed ROS 2 has the whole program.

Exit code: 0; 1 if what it names does not come, or says that it has failed; 130 if interrupted.
"""

import importlib
import os
import sys
import time

import rclpy
import yaml
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# The longest wait for something, seconds of wall time.
PATIENCE_S = 60.0

# How long lists wait for other nodes to be found, and the time between two rates, seconds.
DISCOVERY_S = 2.0
RATE_PERIOD_S = 1.0


def fail(text):
    sys.exit(f"ros2 {' '.join(sys.argv[1:])}: {text}")


def type_of(name):
    """The class of a name such as std_srvs/srv/Empty."""
    package, kind, name = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def fill(message, values):
    """Sets the fields of a message to those of a table, which must have no others."""
    for name, value in values.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def is_success(response):
    """Whether a service did what it was asked for: by `success`, or by the `result` of
    simulation_interfaces. One that has neither cannot fail."""
    if hasattr(response, "success"):
        return response.success
    result = getattr(response, "result", None)
    return result is None or result.result == result.RESULT_OK


class Tool:
    def __init__(self):
        rclpy.init()
        self.node = rclpy.create_node(f"ros2_{os.getpid()}")

    def until(self, holds, words):
        end = time.monotonic() + PATIENCE_S
        while not holds():
            if time.monotonic() > end:
                fail(f"no {words} within {PATIENCE_S} s")
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def done(self, future, words):
        self.until(future.done, words)
        return future.result()

    def call(self, name, kind, request):
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, f"service {name}")
        return self.done(client.call_async(request), f"response of {name}")

    def discover(self):
        end = time.monotonic() + DISCOVERY_S
        while time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def topic_list(self, *options):
        self.discover()
        for topic, kinds in self.node.get_topic_names_and_types():
            print(f"{topic} [{', '.join(kinds)}]" if "-t" in options else topic)

    def node_list(self, *_):
        self.discover()
        for name, namespace in sorted(self.node.get_node_names_and_namespaces()):
            if name != self.node.get_name():
                print(f"{namespace.rstrip('/')}/{name}")

    def subscribe(self, name, durability, take):
        """Subscribes to a topic once it is known, with best effort, which every publisher offers."""
        types = []

        def is_known():
            types.extend(kinds[0] for topic, kinds in self.node.get_topic_names_and_types() if topic == name)
            return types

        self.until(is_known, f"topic {name}")
        qos = QoSProfile(depth=100, durability=DurabilityPolicy.get_from_short_key(durability))
        if durability == "volatile":
            qos.reliability = ReliabilityPolicy.BEST_EFFORT
        self.node.create_subscription(type_of(types[0]), name, take, qos)

    def topic_echo(self, name, *options):
        options = list(options)
        durability = "volatile"
        if "--qos-durability" in options:
            durability = options[options.index("--qos-durability") + 1]
        messages = []
        self.subscribe(name, durability, messages.append)
        while True:
            self.until(lambda: messages, f"message on {name}")
            print(messages.pop(0), flush=True)
            if "--once" in options:
                return

    def topic_hz(self, name, *_):
        stamps = []
        self.subscribe(name, "volatile", lambda _: stamps.append(time.monotonic()))
        while True:
            self.until(lambda: len(stamps) > 1 and stamps[-1] - stamps[0] >= RATE_PERIOD_S, f"message on {name}")
            print(f"average rate: {(len(stamps) - 1) / (stamps[-1] - stamps[0]):.3f}", flush=True)
            stamps.clear()

    def service_list(self, *_):
        def services():
            return [found for found in self.node.get_service_names_and_types() if found[0].startswith("/sim_server/")]

        self.until(services, "service of a run")
        for name, types in services():
            print(name, types)

    def service_call(self, name, kind, values):
        kind = type_of(kind)
        response = self.call(name, kind, fill(kind.Request(), yaml.safe_load(values)))
        print(response)
        if not is_success(response):
            fail(response)

    def action_send_goal(self, name, kind, values, *_):
        kind = type_of(kind)
        client = ActionClient(self.node, kind, name)
        self.until(client.server_is_ready, f"action {name}")
        goal = fill(kind.Goal(), yaml.safe_load(values))
        accepted = self.done(client.send_goal_async(goal, feedback_callback=print), f"answer of {name}")
        if not accepted.accepted:
            fail("rejected")
        print(self.done(accepted.get_result_async(), f"result of {name}"))

    def param_list(self, node):
        print(self.call(f"{node}/list_parameters", ListParameters, ListParameters.Request()).result.names)

    def param_get(self, node, name):
        request = GetParameters.Request(names=[name])
        value = self.call(f"{node}/get_parameters", GetParameters, request).values[0]
        print(value)
        if value.type == ParameterType.PARAMETER_NOT_SET:
            fail("not set")

    def param_describe(self, node, name):
        request = DescribeParameters.Request(names=[name])
        description = self.call(f"{node}/describe_parameters", DescribeParameters, request).descriptors[0]
        print(description)
        if description.type == ParameterType.PARAMETER_NOT_SET:
            fail("not set")

    def param_set(self, node, name, value):
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=float(value))
        request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])
        result = self.call(f"{node}/set_parameters", SetParameters, request).results[0]
        if not result.successful:
            fail(result)


def main(words):
    command = getattr(Tool, "_".join(words[:2]), None) if len(words) > 1 else None
    if command is None:
        sys.exit(__doc__)
    # Options may come before what the command names.
    options, named = [], []
    rest = iter(words[2:])
    for word in rest:
        if word == "--qos-durability":
            options += [word, next(rest)]
        elif word.startswith("-"):
            options.append(word)
        else:
            named.append(word)
    tool = Tool()
    command(tool, *named, *options)
    tool.node.destroy_node()
    rclpy.shutdown()


try:
    main(sys.argv[1:])
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    sys.exit(130)
