#!/usr/bin/env python3
"""Stand-in for the program `ros2` in the test of the code blocks of the documents.

There is no wheel of that program. This one has the commands that the documents show, with the same
arguments, by rclpy; `topic echo` ends after a message. Each waits for what it names.

Exit code: 0; 1 if what it names does not come, or says that it has failed.
"""

import importlib
import sys
import time

import rclpy
import yaml
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile

# The longest wait for something, seconds of wall time.
PATIENCE_S = 60.0


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


class Tool:
    def __init__(self):
        rclpy.init()
        self.node = rclpy.create_node("documented")

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

    def topic_echo(self, name, *options):
        durability = {(): "volatile"}.get(options) or options[options.index("--qos-durability") + 1]
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.get_from_short_key(durability))
        types = []

        def is_known():
            types.extend(kinds[0] for topic, kinds in self.node.get_topic_names_and_types() if topic == name)
            return types

        self.until(is_known, f"topic {name}")
        messages = []
        self.node.create_subscription(type_of(types[0]), name, messages.append, qos)
        self.until(lambda: messages, f"message on {name}")
        print(messages[0])

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
        if response.result.result != response.result.RESULT_OK:
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
        fail("no such command in this stand-in")
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


main(sys.argv[1:])
