"""MAES: a deterministic simulator of teams of robots that explore unknown space in 3-D.

A run is a function of its scenario: the same scenario gives the same digest, whether `maes run` or
`maes.run` executes it. Lengths are metres, angles radians, times seconds or ticks of 20 ms; axes
are right-handed with z up, and the world frame is `map`. A cell is a tuple (x, y, z) of indices.
"""

from ._maes import (
    BUILD,
    Auction,
    BadInput,
    Command,
    Ctx,
    ExplorationMap,
    Motion,
    Observation,
    Path,
    Rng,
    RunFailed,
    WakeCondition,
)
from .controllers import CellState, Controller, EventMask, controllers
from .maps import Map
from .plans import Batch, batch
from .recordings import Recording, RecordingFollower
from .runs import Result, fork, run
from .scenarios import Scenario
from .studies import Study, study

__version__ = BUILD.split("+")[0]

__all__ = [
    "Auction",
    "BUILD",
    "BadInput",
    "Batch",
    "CellState",
    "Command",
    "Controller",
    "Ctx",
    "EventMask",
    "ExplorationMap",
    "Map",
    "Motion",
    "Observation",
    "Path",
    "Recording",
    "RecordingFollower",
    "Result",
    "Rng",
    "RunFailed",
    "Scenario",
    "Study",
    "WakeCondition",
    "batch",
    "controllers",
    "fork",
    "run",
    "study",
]
