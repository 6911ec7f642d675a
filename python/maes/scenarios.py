"""Scenarios: everything that determines a run (docs/scenario.md)."""

from __future__ import annotations

import operator
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from . import _maes

if TYPE_CHECKING:
    from .maps import Map

_DEFAULT = """\
seed = 1
duration_s = 1800.0
[map]
kind = "spheres"
size = 50
[agents]
count = 5
controller = "rbw"
"""

# The words of the command line, each a key of its own.
_SHORT = {
    "agents": "agents.count",
    "controller": "agents.controller",
    "size": "map.size",
    "duration": "duration_s",
    "threads": "execution.threads",
    "share_period": "agents.share_period_ticks",
}


# The integers of TOML.
SEED_MAX = 2**63 - 1


def seed_of(given: Any) -> int:
    """A seed as `int`; also of NumPy, whose integers Gymnasium does not take."""
    try:
        seed = None if isinstance(given, bool) else operator.index(given)
    except TypeError:
        seed = None
    if seed is None or not 0 <= seed <= SEED_MAX:
        raise _maes.BadInput(f"seed = {given!r}: expected a whole number from 0 to 2**63 - 1")
    return seed


def changes_of(keys: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Keys of a call as dotted keys: tables are dictionaries, and `__` stands for a dot."""
    changes: list[tuple[str, Any]] = []
    for key, value in keys.items():
        dotted = key.replace("__", ".")
        if isinstance(value, Mapping):
            changes.extend(_inside(dotted, value))
        else:
            changes.append((_SHORT.get(dotted, dotted), value))
    return changes


def _inside(path: str, table: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """The keys of a table as dotted keys."""
    changes: list[tuple[str, Any]] = []
    for key, value in table.items():
        inner = f"{path}.{key}"
        changes.extend(_inside(inner, value) if isinstance(value, Mapping) else [(inner, value)])
    return changes


class Scenario:
    """A scenario; every value of this class is legal.

    `source` is a scenario file (.toml), a recording (.mcap), or nothing: the five agents in a cave of
    50 cells of `maes run`. A dictionary changes keys of that one, as keywords do. Keywords change
    keys: `seed=3`, tables as dictionaries (`map={"size": 100}`), dotted keys with two underscores
    (`lidar__range_m=20`), and the words `agents`, `controller`, `size`, `duration`, `threads` and
    `share_period` of the command line. `None` removes a key.

    Raises `BadInput` with the key, the value and what is allowed.
    """

    __slots__ = ("_native",)
    _native: _maes.NativeScenario

    def __init__(
        self,
        source: str | os.PathLike[str] | Mapping[str, Any] | None = None,
        /,
        **keys: Any,
    ) -> None:
        changes = changes_of(keys)
        if source is None or isinstance(source, Mapping):
            changes = [*changes_of(source or {}), *changes]
            self._native = _maes.NativeScenario.parse("the scenario", _DEFAULT, changes, "")
        else:
            self._native = _maes.NativeScenario.load(os.fspath(source), changes)

    @classmethod
    def _of(cls, native: _maes.NativeScenario) -> Scenario:
        scenario = cls.__new__(cls)
        scenario._native = native
        return scenario

    @classmethod
    def from_toml(cls, text: str, /, **keys: Any) -> Scenario:
        """A scenario from TOML text; its paths start from the working directory."""
        return cls._of(_maes.NativeScenario.parse("the text", text, changes_of(keys), ""))

    def replace(self, **keys: Any) -> Scenario:
        """The same scenario with other values of some keys.

        Keys that were not given follow from the others, as in `Scenario(**keys)`: with
        `body={"kind": "aerial"}` the speeds are those of aerial bodies. A recording names all keys:
        of these, values that equal the defaults count as not given.
        """
        return self._of(_parsed(self._native.given(), self._native.paths_from, changes_of(keys)))

    def to_toml(self) -> str:
        """All keys as TOML, which `maes run` reads."""
        return self._native.to_toml()

    def to_dict(self) -> dict[str, Any]:
        """All keys as nested dictionaries."""
        return self._native.to_dict()

    def __getitem__(self, key: str) -> Any:
        """The value of a dotted key, for example `scenario["map.size"]`."""
        value: Any = self.to_dict()
        for part in key.split("."):
            value = value[part]
        return value

    @property
    def duration_s(self) -> float:
        """Sim time after which the run ends at the latest, seconds."""
        return self._native.duration_ticks * 0.02

    def map(self) -> Map:
        """The true map of the run, which agents do not know."""
        from .maps import Map

        return Map._of(self._native.map())

    def __reduce__(self) -> tuple[Any, ...]:
        return _copied, (self._native.given(), self._native.paths_from)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self._native == other._native

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __repr__(self) -> str:
        table = self.to_dict()
        agents, of_map = table["agents"], table["map"]
        what = of_map.get("file") or f"{of_map['kind']} {of_map.get('size')}"
        return f"Scenario({agents['count']} x {agents['controller']}, map {what}, seed {table['seed']})"


def _parsed(text: str, paths_from: str, changes: list[tuple[str, Any]]) -> _maes.NativeScenario:
    return _maes.NativeScenario.parse("the scenario", text, changes, paths_from)


def _copied(text: str, paths_from: str) -> Scenario:
    return Scenario._of(_parsed(text, paths_from, []))
