"""Controllers in Python: the vocabulary of docs/controllers.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum, IntFlag
from typing import Any, ClassVar

from . import _maes
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
    version: ClassVar[str | int]
    """Names the code in ids of runs, so that plans keep its runs until it is changed. A class without a
    version of its own runs again in every call of `batch` and `study`; bases do not pass theirs on."""

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


def registered(classes: Sequence[type[Controller]]) -> _maes.Controllers:
    """The built-in controllers and these classes, with their versions."""
    for one in classes:
        if not (isinstance(one, type) and issubclass(one, Controller)):
            raise TypeError(f"controller {one!r}: expected a name, or a subclass of maes.Controller")
    return _maes.Controllers([(one, _version(one)) for one in classes])


def _version(controller: type[Controller]) -> str | None:
    """What stands for the version of a class in ids of runs, in which 1 is not "1"."""
    # That of a base would say nothing about edits of this class.
    if "version" not in vars(controller):
        return None
    version = vars(controller)["version"]
    if isinstance(version, bool) or not isinstance(version, (str, int)) or version == "":
        raise _maes.BadInput(
            f"controller {controller.name}: version = {version!r}: expected a text that is not empty, or a whole number"
        )
    return repr(version)


def controllers() -> list[str]:
    """The names of the built-in controllers."""
    return _maes.Controllers([]).names()
