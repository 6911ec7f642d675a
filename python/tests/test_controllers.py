"""Controllers in Python, and everything that can go wrong in them."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import maes
from maes import Command, Motion, WakeCondition
from maes.node import load

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/python"
NearestFrontier = load(f"{EXAMPLES}/nearest_frontier.py:NearestFrontier")


def controller(decide, **attributes):
    """A class with this function as `decide`."""
    return type("Own", (maes.Controller,), {"decide": decide, **attributes})


def test_port_has_the_digest_of_the_original():
    scenario = maes.Scenario(controller="nearest-frontier", seed=3)
    original = maes.run(scenario)
    port = maes.run(scenario, controller=NearestFrontier, replace=True)
    assert port.digest == original.digest and port.reason == "explored"
    named = maes.run(scenario, controller=NearestFrontier)
    assert named.metrics["controller"] == "nearest-frontier-py"
    assert named.metrics["distance_m"] == original.metrics["distance_m"]


def test_settings_are_declared_and_checked(small):
    taken = []

    def decide(self, observation, ctx):
        taken.append((self.values, self.rng.random()))
        return Command(Motion.stop(), WakeCondition.at(10**9))

    own = controller(decide, settings={"turn_rad": (2.0, 0.0, 3.0), "count": (3, 1, 9), "mode": ["a", "b"]})
    maes.run(small, controller=own, agents__set={"turn_rad": 1, "mode": "b"})
    assert [values for values, _ in taken] == [{"turn_rad": 1.0, "count": 3, "mode": "b"}] * 2
    assert taken[0][1] != taken[1][1], "each agent has a stream of its own"
    for bad, message in [({"turn_rad": 4}, "from 0 to 3"), ({"turns": 1}, "unknown"), ({"mode": "c"}, "a, b")]:
        with pytest.raises(maes.BadInput, match=message):
            maes.run(small, controller=own, agents__set=bad)
    for outside in [(5.0, 0.0, 1.0), (0, 1, 9), (2.0, 3.0, 1.0)]:
        with pytest.raises(maes.BadInput, match="turn = .*: expected a default from the low"):
            maes.run(small, controller=controller(decide, settings={"turn": outside}))
    with pytest.raises(maes.BadInput, match="registered twice"):
        maes.run(small, controller=controller(decide, name="rbw"))
    with pytest.raises(TypeError, match="subclass of maes.Controller"):
        maes.run(small, controller=dict)


def test_map_is_one_array_that_is_kept_up_to_date(small):
    seen = []

    def decide(self, observation, ctx):
        cells = ctx.map.cells
        self.first = getattr(self, "first", cells)
        assert np.shares_memory(cells, self.first) and cells.shape == tuple(ctx.map.size)
        assert not cells.flags.writeable
        with pytest.raises(ValueError):
            cells[0, 0, 0] = 1
        assert (cells == maes.CellState.WALL).sum() == ctx.map.wall
        assert ((cells == maes.CellState.FREE) | (cells == maes.CellState.COVERED)).sum() == ctx.map.free
        frontiers = ctx.map.frontiers
        assert len(frontiers) == ctx.map.frontier_count
        assert all(ctx.map.is_frontier(tuple(map(int, cell))) for cell in frontiers[:5])
        assert ctx.map.state(ctx.cell) == cells[ctx.cell] == maes.CellState.COVERED
        seen.append(ctx.map.free)
        turn = Motion.turn(self.rng.uniform(-3, 3)) if observation.collision else Motion.straight()
        return Command(turn, WakeCondition.TASK_DONE | WakeCondition.at(ctx.tick + 50))

    maes.run(small, controller=controller(decide))
    assert len(seen) > 50 and max(seen) > 500


def returning(value):
    return lambda self, observation, ctx: value() if callable(value) else value


@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        (lambda: Command(Motion.straight(float("nan")), WakeCondition.NEXT_TICK), ValueError, "pitch_rad = NaN"),
        (lambda: Command(Motion.turn(float("inf")), WakeCondition.NEXT_TICK), ValueError, "angle_rad = inf"),
        (lambda: Command(Motion.path([[0.0, 1.0]]), WakeCondition.NEXT_TICK), ValueError, r"expected \(N, 3\)"),
        (lambda: Command(Motion.path([[0.0, 1.0, float("nan")]]), WakeCondition.NEXT_TICK), ValueError, "waypoints = NaN"),
        (lambda: Command(Motion.path(np.zeros((0, 3))), WakeCondition.NEXT_TICK), ValueError, "expected 1 to 1024"),
        (lambda: Command(Motion.path(np.full((1, 3), 1e9)), WakeCondition.NEXT_TICK), ValueError, "motion.path"),
        (lambda: Command(Motion.velocity([0, 0, float("nan")]), WakeCondition.NEXT_TICK), ValueError, "linear_in_body"),
        (lambda: Command.keep(WakeCondition.NEXT_TICK).with_message(bytes(60000), kind=9), ValueError, "57344"),
        (lambda: Command.keep(WakeCondition.NEXT_TICK).with_message(b"x", kind=1), ValueError, "another kind"),
        (lambda: Command.keep(WakeCondition.NEXT_TICK).with_message(b"x", kind=9, to=77), ValueError, "agent 77"),
        (lambda: Command.keep(WakeCondition.NEXT_TICK).with_lidar(0), ValueError, "lidar = 0"),
        (lambda: Command.keep(WakeCondition.NEXT_TICK).with_stage("idle"), ValueError, 'stage = "idle": expected one of'),
        (lambda: None, TypeError, "has returned NoneType: expected maes.Command"),
        (lambda: 1 / 0, ZeroDivisionError, "division by zero"),
        (lambda: sys.exit(3), SystemExit, "3"),
    ],
)
def test_illegal_commands_are_exceptions_of_the_run(small, value, error, message):
    with pytest.raises(error, match=message):
        maes.run(small, controller=controller(returning(value)))


def test_stages_are_named_by_words():
    keep = Command.keep(WakeCondition.NEXT_TICK)
    assert keep.stage is None
    assert [keep.with_stage(word).stage for word in ("exploring", "waiting")] == ["exploring", "waiting"]


def test_original_exception_with_its_traceback(small):
    class Mine(Exception):
        pass

    def decide(self, observation, ctx):
        raise Mine(observation.tick)

    with pytest.raises(Mine) as caught:
        maes.run(small, controller=controller(decide))
    assert caught.traceback[-1].name == "decide"


def test_failing_constructor_is_an_exception(small):
    def fail(self, rng, values):
        raise LookupError("no model file")

    with pytest.raises(LookupError, match="no model file"):
        maes.run(small, controller=controller(None, __init__=fail))
    with pytest.raises(NotImplementedError, match="Own.decide"):
        maes.run(small, controller=type("Own", (maes.Controller,), {}))


def test_context_ends_with_its_decision(small):
    kept = []

    def decide(self, observation, ctx):
        if kept:
            with pytest.raises(RuntimeError, match="after `decide` has returned"):
                kept[0].tick
        kept.append(ctx)
        return Command(Motion.stop(), WakeCondition.at(10**9))

    maes.run(small, controller=controller(decide))
    with pytest.raises(RuntimeError, match="after `decide` has returned"):
        kept[-1].map.cells


def test_context_belongs_to_its_thread(small):
    errors = []

    def use(ctx):
        try:
            ctx.tick
        except RuntimeError as error:
            errors.append(str(error))

    def decide(self, observation, ctx):
        thread = threading.Thread(target=use, args=(ctx,))
        thread.start()
        thread.join()
        assert ctx.tick == observation.tick
        return Command(Motion.stop(), WakeCondition.at(10**9))

    maes.run(small, controller=controller(decide))
    assert len(errors) == 2 and "used in another thread" in errors[0]


def test_run_inside_a_decision(small):
    digests = []

    def decide(self, observation, ctx):
        digests.append(maes.run(small, controller="rbw").digest)
        return Command(Motion.stop(), WakeCondition.at(10**9))

    maes.run(small, controller=controller(decide))
    assert digests == [maes.run(small, controller="rbw").digest] * 2


LOOP = """
import maes, sys
class Loop(maes.Controller):
    def decide(self, observation, ctx):
        print("deciding", flush=True)
        while True:
            pass
try:
    maes.run(controller={controller})
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(7)
"""


def test_ctrl_c_ends_an_endless_decision():
    run = subprocess.Popen(
        [sys.executable, "-c", LOOP.format(controller="Loop")], stdout=subprocess.PIPE, text=True
    )
    assert run.stdout.readline() == "deciding\n"
    run.send_signal(signal.SIGINT)
    output, _ = run.communicate(timeout=60)
    assert "interrupted" in output and run.returncode == 7


def _digest_in_child(scenario, sender):
    sender.send(maes.run(maes.Scenario.from_toml(scenario)).digest)


def test_run_after_fork(small):
    expected = maes.run(small).digest
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_digest_in_child, args=(small.to_toml(), sender))
    child.start()
    assert receiver.poll(60) and receiver.recv() == expected
    child.join(60)
    assert child.exitcode == 0


def test_registration_does_not_grow(small):
    own = controller(returning(lambda: Command(Motion.stop(), WakeCondition.at(10**9))))
    first = maes.run(small, controller=own, duration=1.0).digest
    for _ in range(20):
        assert maes.run(small, controller=own, duration=1.0).digest == first


def test_node_names_its_mistakes():
    for place, message in [("nowhere", "MODULE:CLASS"), ("maes:Map", "subclass"), ("no_such_module:X", "No module")]:
        run = subprocess.run(
            [sys.executable, "-m", "maes.node", place, "--id", "0"], capture_output=True, text=True, timeout=60
        )
        assert run.returncode == 2 and message in run.stderr, run.stderr
    run = subprocess.run(
        [sys.executable, "-m", "maes.node", f"{EXAMPLES}/nearest_frontier.py:NearestFrontier", "--controllers"],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ},
    )
    assert run.returncode == 0 and "nearest-frontier-py" in run.stdout, run.stderr


def test_energy_and_field_of_view_are_those_of_the_scenario(small):
    energy = {"capacity_j": 900.0, "idle_w": 5.0, "move_j_per_m": 2.0, "charge_w": 100.0, "return_home": False}
    lidar = {"pattern": "frustum", "min_range_m": 0.5}
    seen = []

    def decide(self, observation, ctx):
        assert ctx.energy == observation.energy
        seen.append((observation.energy, observation.field_of_view, ctx.is_in_base, ctx.way_home()))
        return Command(Motion.straight(), WakeCondition.at(ctx.tick + 100))

    maes.run(small.replace(energy=energy, lidar=lidar, duration=20.0), controller=controller(decide))
    first, field_of_view, is_in_base, (motion, cost_j) = seen[0]
    # A body with a camera has turned before.
    assert 800.0 < first["left_j"] <= 900.0 and (first["capacity_j"], first["power_w"]) == (900.0, 5.0)
    assert (first["move_j_per_m"], first["charge_w"], first["reserve_j"]) == (2.0, 100.0, 180.0)
    assert first["return_home"] is False and len(first["bases"]) == 1 and first["bases"][0][1] == 2.0
    assert is_in_base and isinstance(motion, Motion) and cost_j == 0.0
    assert min(energy["left_j"] for energy, *_ in seen) < 900.0
    assert field_of_view["horizontal_rad"] == pytest.approx(np.radians(80.0))
    assert (field_of_view["lowest_rad"], field_of_view["min_range_m"]) == (pytest.approx(-np.radians(30.0)), 0.5)

    def without(self, observation, ctx):
        assert ctx.energy is observation.energy is observation.field_of_view is None
        assert not ctx.is_in_base and ctx.way_home() is None
        return Command(Motion.stop(), WakeCondition.at(10**9))

    maes.run(small, controller=controller(without))
