"""A ROS 2 node that controls a run through its services and parameters.

    services.py SCENE [ARGUMENT]

Needs rclpy, maes_msgs and simulation_interfaces (see launch_scripts/ros_env.sh). A scene is a
function of this file; the server has started paused, with two agents, unless the scene says
otherwise. Exit code 0; a failure goes to stderr, with exit code 1.
"""

import math
import sys
import time
import traceback

import rclpy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
import simulation_interfaces.srv as srv
from maes_msgs.srv import ChangeMap
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from simulation_interfaces.action import SimulateSteps
from simulation_interfaces.msg import (
    Bounds,
    EntityCategory,
    EntityFilters,
    Resource,
    SimulationState,
    SimulatorFeatures,
    TagsFilter,
)
from std_msgs.msg import Header

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
TICK_NS = 20_000_000
STOPPED, PLAYING, PAUSED, QUITTING = range(4)
UNSUPPORTED, OK, NOT_FOUND, INCORRECT_STATE, FAILED = range(5)
SERVICES = {
    "get_simulator_features": srv.GetSimulatorFeatures,
    "get_simulation_state": srv.GetSimulationState,
    "set_simulation_state": srv.SetSimulationState,
    "step_simulation": srv.StepSimulation,
    "reset_simulation": srv.ResetSimulation,
    "get_entities": srv.GetEntities,
    "get_entity_state": srv.GetEntityState,
    "get_entities_states": srv.GetEntitiesStates,
    "get_entity_info": srv.GetEntityInfo,
    "get_entity_bounds": srv.GetEntityBounds,
    "set_entity_state": srv.SetEntityState,
    "delete_entity": srv.DeleteEntity,
    "spawn_entity": srv.SpawnEntity,
    "change_map": ChangeMap,
    "list_parameters": ListParameters,
    "get_parameters": GetParameters,
    "get_parameter_types": GetParameterTypes,
    "describe_parameters": DescribeParameters,
    "set_parameters": SetParameters,
    "set_parameters_atomically": SetParametersAtomically,
}


def check(holds, words):
    if not holds:
        sys.exit(f"wrong: {words}")


def equal(got, expected, words=""):
    check(got == expected, f"{words}: got {got}, expected {expected}")


class Caller:
    """A client of the services of a node, subscribed to the clock."""

    def __init__(self, target="sim_server", services=SERVICES):
        self.node = rclpy.create_node("caller")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.ticks = []
        self.events = []
        self.node.create_subscription(Clock, "/clock", self.hear, RELIABLE)
        self.node.create_subscription(ParameterEvent, "/parameter_events", self.events.append, RELIABLE)
        self.clients = {name: self.node.create_client(kind, f"/{target}/{name}") for name, kind in services.items()}
        self.until(lambda: all(client.service_is_ready() for client in self.clients.values()))

    def hear(self, clock):
        self.ticks.append((clock.clock.sec * 1_000_000_000 + clock.clock.nanosec) // TICK_NS)

    def until(self, holds):
        """Waits without limit, and prints the place every ten seconds."""
        printed = time.monotonic()
        while not holds():
            self.executor.spin_once(timeout_sec=0.1)
            if time.monotonic() - printed > 10.0:
                printed = time.monotonic()
                print("still waiting:", file=sys.stderr)
                traceback.print_stack()

    def wait(self, future):
        self.until(future.done)
        return future.result()

    def begin(self, name, /, **fields):
        return self.clients[name].call_async(self.clients[name].srv_type.Request(**fields))

    def call(self, name, /, **fields):
        return self.wait(self.begin(name, **fields))

    def code(self, name, /, **fields):
        return self.call(name, **fields).result.result

    def state(self):
        return self.call("get_simulation_state").state.state

    def set_state(self, state):
        return self.code("set_simulation_state", state=SimulationState(state=state))

    def entity(self, name):
        return self.call("get_entity_state", entity=name).state

    def tick(self):
        """The current tick, from the stamp of a state."""
        stamp = self.entity("agent_0").header.stamp
        return (stamp.sec * 1_000_000_000 + stamp.nanosec) // TICK_NS

    def found(self, **filters):
        response = self.call("get_entities", filters=EntityFilters(**filters))
        return response.result.result, list(response.entities)

    def step(self, steps):
        """Steps, and fails unless the response comes after exactly so many ticks."""
        before = self.tick()
        equal(self.code("step_simulation", steps=steps), OK, "step")
        equal((self.tick(), self.state()), (before + steps, PAUSED), f"after {steps} steps")
        self.until(lambda: self.ticks and self.ticks[-1] >= before + steps)
        equal(self.ticks[-1], before + steps, "the clock stands still at the last step")

    def move(self, name, dx, **flags):
        state = self.entity(name)
        state.pose.position.x += dx
        return self.code("set_entity_state", entity=name, state=state, **(flags or {"set_pose": True}))

    def get(self, *names):
        return self.call("get_parameters", names=names).values

    def set(self, name, value):
        return self.call("set_parameters", parameters=[Parameter(name=name, value=value)]).results[0]


def number(value):
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)


def whole(value):
    return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)


def admitted(caller):
    """Steps once; the response comes when all agents have joined."""
    caller.step(1)


def states(_argument):
    """The state of the simulation: every transition, steps, and a clock that stands still."""
    caller = Caller()
    # The action client of rclpy drops feedback that arrives after the result.
    feedbacks = []
    hear = lambda message: feedbacks.append((message.feedback.completed_steps, message.feedback.remaining_steps))
    feedback = "/sim_server/simulate_steps/_action/feedback"
    caller.node.create_subscription(SimulateSteps.Impl.FeedbackMessage, feedback, hear, RELIABLE)
    features = caller.call("get_simulator_features").features
    wanted = [
        SimulatorFeatures.SIMULATION_STATE_PAUSE,
        SimulatorFeatures.STEP_SIMULATION_SINGLE,
        SimulatorFeatures.STEP_SIMULATION_MULTIPLE,
        SimulatorFeatures.STEP_SIMULATION_ACTION,
        SimulatorFeatures.ENTITY_STATE_SETTING,
    ]
    check(set(wanted) <= set(features.features), features)
    check(SimulatorFeatures.SIMULATION_RESET in features.features, features)
    check(SimulatorFeatures.SPAWNING not in features.features, features)
    equal(caller.state(), STOPPED, "at the start")
    equal(caller.set_state(STOPPED), 101, "stopped already")
    equal(caller.set_state(77), 103, "no such state")
    admitted(caller)
    caller.step(1)
    caller.step(50)
    equal(caller.code("step_simulation", steps=0), FAILED, "no steps")
    equal(caller.code("spawn_entity", name="x"), UNSUPPORTED, "spawn")
    equal(caller.set_state(PAUSED), 101, "paused already")

    # Slow enough to observe; the real-time factor counts from the end of the pause.
    equal(caller.set("execution.rtf", number(2.0)).successful, True, "rtf")
    equal(caller.set_state(PLAYING), OK, "play")
    equal(caller.set_state(PLAYING), 101, "plays already")
    equal(caller.code("step_simulation", steps=1), INCORRECT_STATE, "step while playing")
    heard = len(caller.ticks)
    caller.until(lambda: len(caller.ticks) >= heard + 20)
    equal(caller.move("agent_0", 0.0), INCORRECT_STATE, "a state is set while playing")
    equal(caller.set_state(PAUSED), OK, "pause")
    tick = caller.tick()
    for _ in range(20):
        equal(caller.tick(), tick, "time stands still")
    equal(caller.ticks[-1] <= tick, True, "the clock stands still")
    equal(caller.ticks, sorted(set(caller.ticks)), "the clock runs forwards")

    # A pause ends a long step request, whose response then is a failure.
    caller.set("execution.rtf", number(0.0))
    many = caller.begin("step_simulation", steps=10_000_000)
    caller.until(lambda: caller.ticks[-1] > tick)
    equal(caller.code("step_simulation", steps=1), INCORRECT_STATE, "step while stepping")
    equal(caller.set_state(PAUSED), OK, "pause while stepping")
    equal(caller.wait(many).result.result, FAILED, "steps that were ended")

    # The action sends feedback after every step.
    client = ActionClient(caller.node, SimulateSteps, "/sim_server/simulate_steps")
    caller.until(client.server_is_ready)
    tick = caller.tick()
    goal = caller.wait(client.send_goal_async(SimulateSteps.Goal(steps=5)))
    check(goal.accepted, "the goal is accepted")
    result = caller.wait(goal.get_result_async())
    equal((result.status, result.result.result.result), (4, OK), "the goal has succeeded")
    equal((caller.tick(), caller.state()), (tick + 5, PAUSED), "after five steps")
    caller.until(lambda: len(feedbacks) >= 5)
    equal(feedbacks, [(done, 5 - done) for done in range(1, 6)], "feedback")
    feedbacks.clear()
    goal = caller.wait(client.send_goal_async(SimulateSteps.Goal(steps=10_000_000)))
    other = caller.wait(client.send_goal_async(SimulateSteps.Goal(steps=1)))
    check(goal.accepted and not other.accepted, "one goal at a time")
    cancelled = caller.wait(goal.cancel_goal_async())
    equal(len(cancelled.goals_canceling), 1, "cancel")
    equal(caller.wait(goal.get_result_async()).status, 5, "the goal was cancelled")
    equal(caller.state(), PAUSED, "after a cancelled goal")

    # The run ends, with a result.
    equal(caller.set_state(QUITTING), OK, "quit")


def entities(_argument):
    """Agents as entities: filters, states, infos, and removal."""
    caller = Caller()
    admitted(caller)
    equal(caller.found(), (OK, ["agent_0", "agent_1"]), "all")
    equal(caller.found(filter="_1$"), (OK, ["agent_1"]), "by name")
    equal(caller.found(filter="("), (FAILED, []), "by a broken expression")
    equal(caller.found(categories=[EntityCategory(category=EntityCategory.CATEGORY_HUMAN)]), (OK, []), "by category")
    equal(caller.found(tags=TagsFilter(tags=["rbw"])), (OK, ["agent_0", "agent_1"]), "by tag")
    equal(caller.found(tags=TagsFilter(tags=["lvd"])), (OK, []), "by another tag")
    centre = caller.entity("agent_1").pose.position
    here = Vector3(x=centre.x, y=centre.y, z=centre.z)
    equal(caller.found(bounds=Bounds(type=Bounds.TYPE_SPHERE, points=[here, Vector3(x=0.1)])), (OK, ["agent_1"]), "sphere")
    equal(caller.found(bounds=Bounds(type=Bounds.TYPE_BOX, points=[here, here])), (OK, ["agent_1"]), "box")
    equal(caller.found(bounds=Bounds(type=Bounds.TYPE_CONVEX_HULL)), (UNSUPPORTED, []), "hull")
    both = caller.call("get_entities_states", filters=EntityFilters())
    equal(list(both.entities), ["agent_0", "agent_1"], "states")
    equal(both.states[1], caller.entity("agent_1"), "states are the same")
    equal(both.states[1].header.frame_id, "map", "frame")
    info = caller.call("get_entity_info", entity="agent_1").info
    equal((info.category.category, list(info.tags)), (EntityCategory.CATEGORY_ROBOT, ["rbw"]), "info")
    bounds = caller.call("get_entity_bounds", entity="agent_1").bounds
    equal((bounds.type, bounds.points[0].x), (Bounds.TYPE_BOX, 0.4), "bounds")
    equal(caller.code("get_entity_state", entity="unknown"), NOT_FOUND, "no such entity")

    # A body can only be placed where it fits.
    before = caller.entity("agent_1")
    equal(caller.move("agent_1", 1000.0), 101, "outside the map")
    equal(caller.code("set_entity_state", entity="agent_1", state=caller.entity("agent_0"), set_pose=True), 101, "taken")
    equal(caller.move("agent_1", math.nan), 101, "no number")
    equal(caller.move("agent_1", 0.1, set_twist=True), UNSUPPORTED, "a twist")
    equal(caller.entity("agent_1").pose, before.pose, "what is refused changes nothing")
    equal(caller.move("agent_1", 0.01), OK, "a little further")
    equal(caller.entity("agent_1").pose.position.x, before.pose.position.x + 0.01, "it has moved")

    equal(caller.code("delete_entity", entity="agent_1"), OK, "delete")
    equal(caller.code("delete_entity", entity="agent_1"), NOT_FOUND, "delete again")
    equal(caller.found(), (OK, ["agent_0"]), "the other agent")
    caller.step(10)
    equal(caller.set_state(QUITTING), OK, "quit")


def crowd(argument):
    """The states of a large team come in one answer."""
    caller = Caller()
    admitted(caller)
    agents = [f"agent_{agent}" for agent in range(int(argument))]
    equal(caller.found(), (OK, agents), "all names")
    all_states = caller.call("get_entities_states", filters=EntityFilters())
    equal((all_states.result.result, list(all_states.entities)), (OK, agents), "all states")
    equal(all_states.states[-1], caller.entity(agents[-1]), "the last state")
    equal(caller.set_state(QUITTING), OK, "quit")


def joining(_argument):
    """Agent 2, in reserve, takes the place of agent 1; refused requests leave no trace."""
    caller = Caller()
    admitted(caller)
    features = caller.call("get_simulator_features").features.features
    check(SimulatorFeatures.SPAWNING in features, f"spawning in {features}")
    equal(caller.found(), (OK, ["agent_0", "agent_1"]), "agent 2 waits")
    caller.step(9)
    place = caller.entity("agent_1").pose

    def spawn(name, frame="map", pose=place, **fields):
        initial = PoseStamped(header=Header(frame_id=frame), pose=pose)
        answer = caller.call("spawn_entity", name=name, initial_pose=initial, **fields)
        return answer.result.result, answer.entity_name

    tilted = Pose(position=place.position, orientation=Quaternion(x=1.0, w=0.0))
    equal(spawn("agent_1"), (101, ""), "taken")
    equal(spawn("agent_3"), (102, ""), "unknown")
    equal(spawn(""), (102, ""), "without a name")
    equal(spawn("agent_2", entity_resource=Resource(uri="robot.urdf")), (103, ""), "a resource")
    equal(spawn("agent_2", entity_namespace="elsewhere"), (105, ""), "a namespace")
    equal(spawn("agent_2"), (109, ""), "agent 1 is there")
    equal(spawn("agent_2", pose=tilted), (109, ""), "tilted")
    equal(spawn("agent_2", frame="agent_0/base_link"), (109, ""), "another frame")
    equal(spawn("agent_2", pose=Pose(position=Point(x=-1.0))), (109, ""), "outside the map")
    equal(caller.found(), (OK, ["agent_0", "agent_1"]), "what is refused changes nothing")

    equal(caller.code("delete_entity", entity="agent_1"), OK, "agent 1 leaves with its body")
    equal(spawn("", allow_renaming=True), (OK, "agent_2"), "agent 2 takes its place")
    equal(caller.found(), (OK, ["agent_0", "agent_2"]), "the team")
    joined = caller.entity("agent_2").pose
    equal(joined.position, place.position, "where it joins")
    # The server keeps a heading, whose quaternion may differ in the last bit.
    check(math.isclose(joined.orientation.z, place.orientation.z, abs_tol=1e-12), f"{joined} {place}")
    equal(spawn("agent_2"), (UNSUPPORTED, ""), "no agent waits any more")
    equal(caller.code("reset_simulation", scope=4), UNSUPPORTED, "those that have joined stay")
    caller.step(30)
    equal(caller.set_state(PLAYING), OK, "play")


def again(leaving):
    """Resets a run in every state, and then lets it run to its end."""
    caller = Caller()
    admitted(caller)
    caller.step(30)
    start = caller.entity("agent_0").pose
    equal(caller.move("agent_0", 0.05), OK, "moved")
    equal(caller.code("reset_simulation", scope=1), UNSUPPORTED, "the time without the state")
    equal(caller.code("reset_simulation", scope=4), OK, "nothing was spawned")
    equal(caller.tick(), 31, "nothing was reset")

    def begun_again(state, words):
        equal((caller.state(), caller.tick()), (state, 0), words)
        caller.ticks.clear()

    equal(caller.code("reset_simulation"), OK, "reset")
    begun_again(STOPPED, "after a reset")
    caller.step(31)
    equal(caller.entity("agent_0").pose, start, "the same again")
    equal(caller.set_state(STOPPED), OK, "stop")
    begun_again(STOPPED, "after a stop")
    equal(caller.set_state(STOPPED), 101, "stopped already")
    equal(caller.code("reset_simulation"), OK, "reset while agents come back")
    begun_again(STOPPED, "after two resets in a row")
    equal(caller.set("execution.rtf", number(2.0)).successful, True, "rtf")
    equal(caller.set_state(PLAYING), OK, "play")
    caller.until(lambda: caller.ticks and caller.ticks[-1] >= 20)
    equal(caller.code("delete_entity", entity=leaving), OK, "an agent leaves, and its part of a process ends")
    equal(caller.code("reset_simulation", scope=255), OK, "reset while playing, and it joins again")
    equal(caller.state(), PLAYING, "it plays as it did")
    equal(caller.get("execution.rtf")[0].double_value, 2.0, "at the same pace")
    equal(caller.set("execution.rtf", number(0.0)).successful, True, "as fast as possible")


def intervention(distance):
    """Moves agent 1 at tick 40 and resumes the run; with distance 0, only pauses and resumes."""
    caller = Caller()
    admitted(caller)
    caller.step(39)
    if float(distance):
        equal(caller.move("agent_1", float(distance)), OK, "move")
    caller.step(3)
    equal(caller.set_state(PLAYING), OK, "play")


def changing(_argument):
    """The map becomes a hall, and then gets a lower ceiling; refused requests leave no trace."""
    caller = Caller()
    admitted(caller)
    caller.step(9)
    everywhere = 1e9

    def change(kind, low, high):
        corner = lambda values: Point(x=values[0], y=values[1], z=values[2])
        answer = caller.call("change_map", kind=kind, low=corner(low), high=corner(high))
        return answer.success, answer.message, answer.changed

    bodies = [caller.entity(name).pose.position for name in ("agent_0", "agent_1")]
    place = [bodies[0].x, bodies[0].y, bodies[0].z]
    free, wall = ChangeMap.Request.FREE, ChangeMap.Request.WALL
    for kind, low, high, words in (
        (wall, [along - 1.0 for along in place], [along + 1.0 for along in place], "a body, a relay or an obstacle is in the box"),
        (wall, [3.0] * 3, [2.0] * 3, "no cell has its centre in the box"),
        (free, [-5.0] * 3, [0.9] * 3, "no cell has its centre in the box"),
        (free, [math.nan] * 3, [math.nan] * 3, "no cell has its centre in the box"),
        (7, [-everywhere] * 3, [everywhere] * 3, "kind = 7: expected 0 (FREE) or 1 (WALL)"),
    ):
        success, message, changed = change(kind, low, high)
        check((success, changed) == (False, 0) and words in message, f"{words}: {success}, {changed}, {message}")
    success, message, opened = change(free, [-everywhere] * 3, [everywhere] * 3)
    check(success and opened > 0, f"a hall: {message}, {opened}")
    equal(change(free, [-everywhere] * 3, [everywhere] * 3), (True, "", 0), "it is free already")
    caller.step(10)
    ceiling_m = max(body.z for body in bodies) + 2.0
    success, message, closed = change(wall, [0.0, 0.0, ceiling_m], [everywhere] * 3)
    check(success and 0 < closed < opened, f"a ceiling: {message}, {closed}, {opened}")
    equal(caller.set_state(PLAYING), OK, "play")


def parameters(_argument):
    """The parameters of the server, and of an agent that offers them."""
    caller = Caller()
    names = caller.call("list_parameters", prefixes=[], depth=0).result.names
    for name in ("seed", "map.size", "execution.rtf", "use_sim_time", "agents.count"):
        check(name in names, f"{name} in {names}")
    equal(caller.call("list_parameters", prefixes=["map.noise"], depth=0).result.names, ["map.noise.fill", "map.noise.smoothing"])
    count, size, nothing = caller.get("agents.count", "map.size", "nothing")
    equal((count.integer_value, size.integer_value, nothing.type), (2, 20, ParameterType.PARAMETER_NOT_SET), "values")
    equal(list(caller.call("get_parameter_types", names=["seed", "nothing"]).types), [2, 0], "types")
    described = caller.call("describe_parameters", names=["execution.rtf", "agents.count"]).descriptors
    equal([one.read_only for one in described], [False, True], "read-only")
    equal(described[1].integer_range[0].to_value, 1000, "range")
    check(all(one.description for one in described), "described")
    equal(caller.set("agents.count", whole(3)).successful, False, "what is read-only is refused")
    for wrong in (number(-1.0), number(1e-9), number(math.nan), whole(1)):
        equal(caller.set("execution.rtf", wrong).successful, False, f"{wrong}")
    pace = Parameter(name="execution.rtf", value=number(3.0))
    both = [pace, Parameter(name="seed", value=whole(3))]
    equal(caller.call("set_parameters_atomically", parameters=both).result.successful, False, "all or none")
    equal(caller.get("execution.rtf")[0].double_value, 0.0, "none")
    equal(caller.call("set_parameters_atomically", parameters=[pace]).result.successful, True, "all")
    caller.until(lambda: any(event.node == "/sim_server" for event in caller.events))
    changed = [event for event in caller.events if event.node == "/sim_server"][0].changed_parameters
    equal([(one.name, one.value.double_value) for one in changed], [("execution.rtf", 3.0)], "the event")

    agent = Caller("agent_0", {name: kind for name, kind in SERVICES.items() if "parameter" in name})
    agent.until(lambda: "controller" in agent.call("list_parameters", prefixes=[], depth=0).result.names)
    controller, number_of_it = agent.get("controller", "id")
    equal((controller.string_value, number_of_it.integer_value), ("rbw", 0), "agent 0")
    described = agent.call("describe_parameters", names=["set.pitch_min_rad"]).descriptors[0]
    equal((described.read_only, described.floating_point_range[0].from_value), (True, 0.0), "a setting of the controller")
    equal(agent.set("id", whole(3)).successful, False, "an agent stays what it is")
    equal(caller.set_state(QUITTING), OK, "quit")


def nonsense(_argument):
    """Malformed requests, and a flood of them; then resumes the run."""
    caller = Caller()
    admitted(caller)
    caller.step(20)
    huge = "x" * 40_000
    for name in ("get_entity_state", "get_entity_info", "get_entity_bounds", "delete_entity"):
        equal(caller.code(name, entity=huge), NOT_FOUND, name)
        equal(caller.code(name, entity="agent_4294967296"), NOT_FOUND, name)
    state = caller.entity("agent_0")
    for wrong in (math.nan, math.inf, -math.inf, 1e300):
        state.pose.position.y = wrong
        equal(caller.code("set_entity_state", entity="agent_0", state=state, set_pose=True), 101, f"{wrong}")
    state = caller.entity("agent_0")
    for wrong in (math.nan, 0.0, 5.0):
        state.pose.orientation = Quaternion(x=wrong, y=wrong, z=wrong, w=wrong)
        equal(caller.code("set_entity_state", entity="agent_0", state=state, set_pose=True), 101, f"{wrong}")
    many = [Vector3(x=math.nan)] * 1000
    equal(caller.found(bounds=Bounds(type=Bounds.TYPE_BOX, points=many))[0], FAILED, "points")
    equal(caller.found(tags=TagsFilter(tags=["x"] * 3000, filter_mode=9))[0], FAILED, "tags")
    equal(caller.found(filter="(((a{50}){50}){50}){50}")[0], FAILED, "an expression that explodes")
    caller.call("get_parameters", names=["x"] * 4000)
    caller.call("set_parameters", parameters=[Parameter(name=f"x{i}") for i in range(300)])
    equal(caller.code("step_simulation", steps=0), FAILED, "steps")
    equal(caller.set_state(255), 103, "state")

    for _ in range(3000):
        caller.begin("get_entities_states", filters=EntityFilters())
        caller.begin("set_simulation_state", state=SimulationState(state=9))
    # Behind the flood the response may come after the end of the run, and be lost with the server.
    played = caller.begin("set_simulation_state", state=SimulationState(state=PLAYING))
    server = caller.clients["set_simulation_state"]
    caller.until(lambda: played.done() or not server.service_is_ready())
    check(not played.done() or played.result().result.result == OK, "play")


def hurry(_argument):
    """Sets an unlimited real-time factor, of a run that need not be paused."""
    caller = Caller("sim_server", {"set_parameters": SetParameters})
    equal(caller.set("execution.rtf", number(0.0)).successful, True, "as fast as possible")


def pace(argument):
    """Waits for a real-time factor set by another client, and sets another one, which the run then
    has.
    """
    caller = Caller()
    caller.until(lambda: caller.get("execution.rtf")[0].double_value == float(argument))
    equal(caller.set("execution.rtf", number(3.0)).successful, True, "another one")
    # A run responds after it has applied the parameter.
    equal(caller.state(), STOPPED, "it has not begun")


def main():
    rclpy.init()
    timing = (states, again, hurry, pace)
    team = (entities, crowd, joining, intervention, changing)
    scenes = {scene.__name__: scene for scene in (*timing, *team, parameters, nonsense)}
    scenes[sys.argv[1]](sys.argv[2] if len(sys.argv) > 2 else None)
    print("done", flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main()
