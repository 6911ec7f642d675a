"""Recordings as NumPy arrays and dictionaries."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _maes
from .maps import Map
from .scenarios import Scenario


class Poses(NamedTuple):
    """Poses of one agent over sim time."""

    time_s: npt.NDArray[np.float64]
    """Sim time, seconds: shape (N,)."""
    position_m: npt.NDArray[np.float64]
    """Centre of the body, metres, frame `map`: shape (N, 3)."""
    yaw_rad: npt.NDArray[np.float64]
    """Heading, 0 along x, positive to the left: shape (N,)."""


class Scan(NamedTuple):
    """What an agent saw for the first time, up to an observation."""

    time_s: float
    """Sim time of the observation, seconds."""
    free: npt.NDArray[np.uint32]
    """Indices of free cells, ascending; index = (z * size_y + y) * size_x + x."""
    wall: npt.NDArray[np.uint32]
    """Indices of walls, ascending."""


class Hits(NamedTuple):
    """Where the rays of a scan have hit walls."""

    time_s: float
    """Sim time of the scan, seconds."""
    point_m: npt.NDArray[np.float32]
    """Metres, in the frame of the body at that time: shape (N, 3)."""


class Recording:
    """A recording (.mcap) of a run (docs/recording.md), read into memory."""

    __slots__ = ("_native", "file")

    def __init__(self, file: str | os.PathLike[str]) -> None:
        self.file = os.fspath(file)
        self._native = _maes.NativeRecording.open(self.file)

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run."""
        return Scenario._of(self._native.scenario)

    def map(self) -> Map | None:
        """The true map, if the recording has it."""
        native = self._native.map()
        return None if native is None else Map._of(native)

    def topics(self) -> dict[str, int]:
        """The number of messages by topic."""
        return self._native.topics()

    def messages(self, topic: str) -> list[tuple[float, Any]]:
        """Sim time in seconds and content of each message of a topic: a dictionary of its fields, or
        the CDR bytes of types that this package does not decode."""
        return self._native.messages(topic)

    def poses(self, agent: int) -> Poses:
        """The poses of an agent, at each of its committed observations."""
        return Poses(*self._native.poses(agent))

    def scans(self, agent: int) -> list[Scan]:
        """What an agent saw for the first time, by observation."""
        return [Scan(*scan) for scan in self._native.scans(agent)]

    def lidars(self, agent: int) -> list[str]:
        """The names of an agent's `[[lidars]]`; empty if it has a `[lidar]`."""
        return self._native.lidars(agent)

    def hits(self, agent: int, lidar: str | None = None) -> list[Hits]:
        """Where the rays of an agent's scans, or of those of one of its `[[lidars]]`, have hit
        walls; empty unless the recording has the topics `points` (`views.record`)."""
        return [Hits(*scan) for scan in self._native.hits(agent, lidar)]

    def result(self) -> dict[str, Any] | None:
        """Digest, reason, tick and metrics at the end; `None` if the recording has no result."""
        return self._native.result()

    @classmethod
    def _of(cls, file: str, native: _maes.NativeRecording) -> Recording:
        recording = cls.__new__(cls)
        recording.file, recording._native = file, native
        return recording

    def __repr__(self) -> str:
        return f"Recording({self.file!r})"


class RecordingFollower:
    """A recording that a run is still writing, read part by part.

    Runs save their recordings every half second of wall time. That of a killed server has no end.
    """

    __slots__ = ("_native", "file")

    def __init__(self, file: str | os.PathLike[str]) -> None:
        self.file = os.fspath(file)
        self._native = _maes.NativeFollower(self.file)

    def read(self) -> Recording:
        """A recording of the messages since the last call, each tick with all of its messages."""
        return Recording._of(self.file, self._native.read())

    @property
    def has_ended(self) -> bool:
        """Whether the end of the recording has been read."""
        return self._native.has_ended
