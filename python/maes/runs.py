"""Runs in this process, over the in-memory link."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from . import _maes
from ._frames import frame
from .controllers import Controller, registered
from .scenarios import Scenario, changes_of


class Result:
    """The figures of a run. `series` and `agents` are its course, sampled every 10 s of sim time."""

    __slots__ = ("_native", "counters", "metrics", "record", "scenario")

    def __init__(
        self, native: _maes.RunResult, scenario: Scenario | None, record: str | None
    ) -> None:
        self._native = native
        self.scenario = scenario
        """The scenario that was run; `None` for a fork."""
        self.record = record
        """The file of the recording, if there is one."""
        self.metrics: dict[str, Any] = native.metrics()
        """All metrics of a row of `runs.csv` (docs/experiments.md)."""
        self.counters: dict[str, int] = dict(native.counters)
        """Counters of the result message, such as "scans" and "collisions"."""

    @property
    def digest(self) -> str:
        """The digest of the run, hexadecimal, which `maes run` prints for the same scenario."""
        return self._native.digest

    @property
    def reason(self) -> str:
        """Why it ended, such as "explored" or "duration"."""
        return self._native.reason

    @property
    def tick(self) -> int:
        """The last tick; one tick is 20 ms of sim time."""
        return self._native.tick

    @property
    def end_s(self) -> float:
        """Sim time at which it ended, seconds."""
        return float(self.metrics["end_s"])

    @property
    def explored(self) -> float:
        """Share of the free cells that the team has seen, 0 to 1."""
        return float(self.metrics["explored"])

    def columns(self, table: str = "series") -> dict[str, list[Any]]:
        """The columns of the table "runs", "series" or "agents", as the CSV files of a plan have them."""
        return self._native.table(table)

    def frame(self, table: str = "series", library: str | None = None) -> Any:
        """The same as a data frame of polars or pandas."""
        return frame(self.columns(table), library)

    def plot(self, ax: Any = None) -> Any:
        """Draw the explored share over sim time with matplotlib."""
        import matplotlib.pyplot as plt

        if ax is None:
            _, ax = plt.subplots()
        series = self.columns("series")
        ax.plot(series["t_s"], series["explored"], label=self.metrics["controller"])
        ax.set_xlabel("sim time (s)")
        ax.set_ylabel("explored share")
        ax.set_ylim(0, 1)
        return ax

    def _repr_svg_(self) -> str | None:
        """The curve of exploration for notebooks, where matplotlib is installed."""
        try:
            from io import StringIO

            from matplotlib.figure import Figure
        except ModuleNotFoundError:
            return None
        figure = Figure(figsize=(5, 3), layout="constrained")
        self.plot(figure.subplots()).set_title(repr(self), fontsize=8)
        text = StringIO()
        figure.savefig(text, format="svg")
        return text.getvalue()

    def __repr__(self) -> str:
        return (
            f"Result({self.reason} after {self.end_s:.2f} s, explored {self.explored:.4f}, "
            f"digest {self.digest[:8]}...)"
        )


def run(
    scenario: Scenario | str | os.PathLike[str] | None = None,
    /,
    *,
    controller: str | type[Controller] | None = None,
    replace: bool = False,
    record: str | os.PathLike[str] | None = None,
    **keys: Any,
) -> Result:
    """Run a scenario in this process, without a network; `keys` change it as in `Scenario`.

    `controller` is the name of a built-in one, or a subclass of `Controller`. With `replace` the
    class runs in place of the controller that the scenario names, and scenario, recording and digest
    keep that name: so a port of an algorithm is compared with the original.

    `record` is the file of a recording (.mcap), or a folder for one (with / at its end).

    Raises `BadInput`, `RunFailed`, whatever `decide` raises, and KeyboardInterrupt after Ctrl-C,
    each of which ends the run. Other Python threads continue meanwhile: the GIL is held during
    decisions of Python controllers only.
    """
    wanted = scenario if isinstance(scenario, Scenario) else Scenario(scenario)
    classes: list[type[Controller]] = []
    if isinstance(controller, str):
        keys = {**keys, "agents__controller": controller}
    elif controller is not None:
        classes = [controller]
    known = registered(classes)
    if classes and not replace:
        keys = {**keys, "agents__controller": classes[0].name}
    if keys:
        wanted = wanted.replace(**keys)
    substitute = classes[0].name if classes and replace else None
    file = None if record is None else os.fspath(record)
    native = _maes.run(
        wanted._native, known, has_python=bool(classes), substitute=substitute, record=file
    )
    return Result(native, wanted, file or wanted.to_dict()["execution"].get("record"))


def fork(
    recording: str | os.PathLike[str],
    /,
    *,
    at_s: float,
    controllers: Sequence[type[Controller]] = (),
    record: str | os.PathLike[str] | None = None,
    **keys: Any,
) -> Result:
    """Take a recorded run up to `at_s` of sim time, and continue with other keys (docs/what-if.md)."""
    known = registered(controllers)
    changes = changes_of(keys)
    file = None if record is None else os.fspath(record)
    native = _maes.fork(
        os.fspath(recording), at_s, changes, known, has_python=bool(controllers), record=file
    )
    return Result(native, None, file or dict(changes).get("execution.record"))
