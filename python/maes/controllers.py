"""Controllers in Python: the vocabulary of docs/controllers.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum, IntFlag
from typing import Any, ClassVar

from . import _maes
from ._code import code_of
from ._maes import Command, Ctx, Observation, Rng


class EventMask(IntFlag):
    """What can have happened since the last observation, and what a wake-up condition can name."""

    TASK_DONE = 1
    COLLISION = 2
    NEW_CELL = 4
    CONTACTS = 8
    MESSAGE = 16
    FIRST_CONTACT = 32
    REVISED = 64


class CellState(IntEnum):
    """The state of a cell on the map of an agent."""

    UNEXPLORED = 0
    FREE = 1
    COVERED = 2
    WALL = 3


class Controller:
    """The algorithm of one agent. Subclasses implement `decide`.

    Each agent has an instance of its own, which keeps its state between decisions. A run is
    repeatable if each decision is a function of the observations, the map and `self.rng` alone.
    Instances are also built to check settings before a run, so a constructor has no side effects.
    """

    name: ClassVar[str] = ""
    """The name in scenarios and results; the name of the class by default."""
    stream: ClassVar[str | None] = None
    """The purpose of the random stream; `name` by default."""
    settings: ClassVar[Mapping[str, tuple[float, float, float] | Sequence[str]]] = {}
    """Settings by key: (default, least, greatest), all float or all int; or words, the first of
    which is the default. The keys of the scenario's table `agents.set`."""

    def __init_subclass__(cls, **arguments: Any) -> None:
        super().__init_subclass__(**arguments)
        if "name" not in cls.__dict__:
            cls.name = cls.__name__

    def __init__(self, rng: Rng, values: dict[str, Any]) -> None:
        """`rng` is the random stream of the agent, `values` are its settings."""
        self.rng = rng
        self.values = values

    def decide(self, observation: Observation, ctx: Ctx) -> Command:
        """Reply to an observation. `ctx` is valid until this returns."""
        raise NotImplementedError(f"{type(self).__name__}.decide")


def registered(classes: Sequence[type[Controller]], codes: Sequence[str] | None = None) -> _maes.Controllers:
    """The built-in controllers and these classes, with what stands for their code in ids of runs."""
    for one in classes:
        if not (isinstance(one, type) and issubclass(one, Controller)):
            raise TypeError(f"controller {one!r}: expected a name, or a subclass of maes.Controller")
    return _maes.Controllers(list(zip(classes, codes or map(code_of, classes))))


def controllers() -> list[str]:
    """The names of the built-in controllers."""
    return _maes.Controllers([]).names()
