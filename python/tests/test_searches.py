"""Path searches of controllers in Python: those of the controllers in Rust."""

from pathlib import Path

import numpy as np
import pytest

import maes
from maes import CellState, Command, EventMask, Motion, WakeCondition
from maes.node import load

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/python"
NearestFrontier = load(f"{EXAMPLES}/nearest_frontier.py:NearestFrontier")


class WithMask:
    """A context whose nearest frontier comes from a search with a mask."""

    def __init__(self, ctx):
        self._ctx = ctx

    def __getattr__(self, name):
        return getattr(self._ctx, name)

    def nearest_frontier(self, excluded):
        goal = np.zeros(self._ctx.map.size, dtype=bool)
        goal[tuple(self._ctx.map.frontiers.T)] = True
        for cell in excluded:
            goal[cell] = False
        path = self._ctx.search(goal)
        return None if path is None else tuple(path.cells[-1].tolist())


class Searching(NearestFrontier):
    def decide(self, observation, ctx):
        return super().decide(observation, WithMask(ctx))


def test_port_by_a_mask_has_the_digest_of_the_original():
    scenario = maes.Scenario(controller="nearest-frontier", size=60, agents=3, seed=3)
    original = maes.run(scenario)
    port = maes.run(scenario, controller=Searching, replace=True)
    assert port.digest == original.digest and port.reason == "explored"


def checking(check):
    """Calls `check` in every decision of a nearest-frontier run."""

    class Checking(NearestFrontier):
        def decide(self, observation, ctx):
            if observation.scan_tick is not None:
                check(ctx)
            return super().decide(observation, ctx)

    return Checking


def test_searches_agree(small):
    compared = []

    def check(ctx):
        frontiers = ctx.map.frontiers
        if not len(frontiers):
            return
        nearest = ctx.search(frontiers)
        lengths_m = ctx.path_lengths_m(frontiers)
        if nearest is None:
            assert np.isinf(lengths_m).all()
            return
        assert nearest.length_m == lengths_m.min()
        assert tuple(nearest.cells[0].tolist()) == ctx.cell
        assert tuple(nearest.cells[-1].tolist()) == ctx.nearest_frontier()
        free = (ctx.map.cells == CellState.FREE) | (ctx.map.cells == CellState.COVERED)
        assert free[tuple(nearest.cells[1:].T)].all(), "only through cells known to be free"
        steps = np.abs(np.diff(nearest.cells, axis=0)).max(axis=1)
        assert (steps == 1).all()
        cell = tuple(frontiers[np.where(np.isfinite(lengths_m), lengths_m, -1).argmax()].tolist())
        path = ctx.search([cell])
        assert path.length_m == lengths_m.max(where=np.isfinite(lengths_m), initial=0)
        if not ctx.is_clear_to(cell):
            assert path.motion == ctx.go_to_cell(cell)
            compared.append(len(path.cells))

    maes.run(small, controller=checking(check))
    assert len(compared) > 10 and max(compared) > 5


def test_limits_of_a_search(small):
    cut = []

    def check(ctx):
        path = ctx.search(ctx.map.frontiers)
        if path is None or len(path.cells) < 4:
            return
        assert ctx.search(ctx.map.frontiers, cells_max=1) is None
        nothing = np.zeros(ctx.map.size, dtype=bool)
        assert ctx.search(ctx.map.frontiers, within=nothing) is None
        along = nothing.copy()
        along[tuple(path.cells.T)] = True
        again = ctx.search(ctx.map.frontiers, within=along)
        assert (again.cells == path.cells).all() and again.length_m == path.length_m
        assert ctx.search(nothing) is None and ctx.search([]) is None
        assert ctx.path_lengths_m([]).shape == (0,)
        wall = np.argwhere(ctx.map.cells == CellState.WALL)[:1]
        assert ctx.search(wall) is None and np.isinf(ctx.path_lengths_m(wall)).all()
        assert ctx.search(ctx.map.frontiers, neighbours=6).length_m >= path.length_m
        cut.append(path)

    maes.run(small, controller=checking(check))
    assert cut, "there were paths of four cells"


def test_time_is_that_of_the_motion(small):
    """Bodies that move alone take the time of the estimate, or up to a tenth less."""
    shares = []

    class Timed(maes.Controller):
        def __init__(self, rng, values):
            super().__init__(rng, values)
            self.due = None

        def decide(self, observation, ctx):
            if observation.scan_tick is None:
                return Command.keep(WakeCondition.NEXT_TICK)
            if self.due is not None and not observation.collision:
                start_tick, time_s = self.due
                shares.append((observation.tick - start_tick) * 0.02 / time_s)
            self.due = None
            path = ctx.search(ctx.map.frontiers)
            if path is None or path.motion is None:
                return Command(Motion.stop(), WakeCondition.at(ctx.tick + 50))
            self.due = (ctx.tick, path.time_s)
            return Command(path.motion, WakeCondition.on(EventMask.TASK_DONE | EventMask.COLLISION))

    maes.run(small, agents=1, duration=300.0, controller=Timed)
    assert len(shares) > 10 and all(0.9 <= share <= 1.0 for share in shares), shares


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda ctx: ctx.search(np.zeros((2, 2, 2), dtype=bool)), "goal has shape .2, 2, 2.: expected that of the map"),
        (lambda ctx: ctx.search([(1, 2)]), "goal has shape .1, 2.: expected cells"),
        (lambda ctx: ctx.search([(1, 2, 400)]), "goal has the cell .1.0, 2.0, 400.0.: expected cells"),
        (lambda ctx: ctx.search([(1, 2, -1)]), "goal has the cell"),
        (lambda ctx: ctx.search([(1, 2, 0.5)]), "goal has the cell"),
        (lambda ctx: ctx.search([(1, 2, float("nan"))]), "goal has the cell"),
        (lambda ctx: ctx.search("there"), "goal has the type str"),
        (lambda ctx: ctx.search([(1, 2, 3)], neighbours=8), "neighbours = 8: expected 6 or 26"),
        (lambda ctx: ctx.search([(1, 2, 3)], within=np.ones((1, 1, 1), dtype=bool)), "within has shape"),
        (lambda ctx: ctx.path_lengths_m([(1, 2, 400)]), "cells has the cell"),
    ],
)
def test_wrong_goals_are_named(small, call, message):
    def decide(self, observation, ctx):
        with pytest.raises(ValueError, match=message):
            call(ctx)
        return Command(Motion.stop(), WakeCondition.at(10**9))

    maes.run(small, controller=type("Own", (maes.Controller,), {"decide": decide}))
