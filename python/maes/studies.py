"""A comparison of planners over seeds, in one call (docs/comparing.md)."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from . import _maes
from .controllers import Controller
from .plans import Batch, batch
from .scenarios import Scenario, seed_of

# Times at which the curves of runs are read.
_POINTS = 201
# Quartiles of the runs around the mean.
_BAND = (25, 75)
# What the measures of verdicts are ratios or differences of.
_COMPARED = {
    "area": "mean time until a cell is seen",
    "explored": "explored share at the end",
    "distance": "distance of the team",
}


class Study(Batch):
    """Planners that have run on the same worlds. Notebooks show its verdicts and its figure."""

    __slots__ = ("_temporary", "planners")

    def __init__(
        self,
        done: Batch,
        planners: Sequence[str],
        temporary: tempfile.TemporaryDirectory[str] | None = None,
    ) -> None:
        super().__init__(done.folder, done.failures)
        self.planners = list(planners)
        """Their names, in the order of the call."""
        # Its folder goes with it.
        self._temporary = temporary

    @property
    def verdicts(self) -> list[str]:
        """A sentence for each pair of planners: effect, 95 % interval, number of maps and p-value, as
        in reports. `frame("verdicts")` has their numbers."""
        return list(self.columns("verdicts")["verdict"])

    def plot(self) -> Any:
        """A figure of matplotlib. Left: the explored share over sim time, the mean and the quartiles of
        the runs of each planner; right: the effect of each pair with its interval."""
        import matplotlib.pyplot as plt

        figure = plt.figure(figsize=(10, 4), layout="constrained")
        self._draw(figure)
        return figure

    def _draw(self, figure: Any) -> None:
        curves, effects = figure.subplots(1, 2, width_ratios=(3, 2))
        self._draw_curves(curves)
        self._draw_effects(effects)

    def _draw_curves(self, ax: Any) -> None:
        runs, series = self.columns("runs"), self.columns("series")
        points: dict[str, list[tuple[float, float]]] = {id: [] for id in runs["id"]}
        for id, t_s, explored in zip(series["id"], series["t_s"], series["explored"]):
            points[id].append((t_s, explored))
        times = np.linspace(0.0, max(series["t_s"], default=1.0), _POINTS)
        for planner in self.planners:
            of_planner = zip(runs["id"], runs["axis.agents.controller"])
            ids = [id for id, controller in of_planner if controller == planner]
            if not ids:
                continue
            # A run keeps the share with which it has ended.
            shares = np.array([np.interp(times, *np.array(points[id]).T) for id in ids])
            (line,) = ax.plot(times, 100 * shares.mean(axis=0), label=f"{planner} ({len(ids)} runs)")
            low, high = 100 * np.percentile(shares, _BAND, axis=0)
            ax.fill_between(times, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
        ax.set(xlabel="sim time (s)", ylabel="explored (%): mean and quartiles", ylim=(0, 101))
        ax.legend()

    def _draw_effects(self, ax: Any) -> None:
        found = self.columns("verdicts")
        is_ratio = "ratio" in found["effect"]
        names = []
        for row, (a, b, estimate) in enumerate(zip(found["a"], found["b"], found["estimate"])):
            names.append(f"{a} {'/' if is_ratio else '-'} {b}")
            if estimate is None:
                continue
            low, high = found["low"][row], found["high"][row]
            if low is not None and high is not None:
                ax.plot([low, high], [row, row], color="black", linewidth=1)
            ax.plot(estimate, row, "o", color="black")
        ax.axvline(1.0 if is_ratio else 0.0, color="grey", linestyle=":")
        ax.set_yticks(range(len(names)), names)
        ax.set_ylim(len(names) - 0.5, -0.5)
        measure = next(iter(found["measure"]), "")
        compared = _COMPARED.get(measure, measure.replace("time-", "time to ") + " %")
        ax.set_xlabel(f"{compared}:\n{'ratio' if is_ratio else 'points'}, 95 % interval")

    def _repr_html_(self) -> str:
        """The verdicts and, where matplotlib is installed, the figure, for notebooks."""
        found = self.columns("verdicts")
        lines = [text for pair in zip(found["verdict"], found["second"]) for text in pair if text]
        lines += [f"Run {id} has failed: {why}" for id, why in self.failures.items()]
        text = "".join(f"<p>{escape(line)}</p>" for line in lines)
        try:
            from matplotlib.figure import Figure
        except ModuleNotFoundError:
            return text
        figure, drawn = Figure(figsize=(10, 4), layout="constrained"), StringIO()
        self._draw(figure)
        figure.savefig(drawn, format="svg")
        svg = drawn.getvalue()
        return text + svg[svg.index("<svg") :]

    def __repr__(self) -> str:
        return "\n".join([f"Study({os.fspath(self.folder)!r}, {len(self.failures)} failures)", *self.verdicts])


def study(
    planners: Iterable[str | type[Controller]],
    seeds: Iterable[int],
    scenario: Scenario | str | os.PathLike[str] | Mapping[str, Any] | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    primary: str = "area",
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool | None = None,
    prune: bool = False,
    **keys: Any,
) -> Study:
    """Run two planners or more on the same worlds, and compare them pair by pair.

    Planners are names of built-in controllers and subclasses of `Controller`. Each runs once with each
    of `seeds`, so on the same maps; `keys` change the scenario as in `Scenario`. `primary` is the
    measure that the verdicts are about: "area", "time-90", "time-99", "time-100", "explored" or
    "distance" (docs/statistics.md). No p-value is given below six maps.

    It is a plan of `batch` in the folder `out`, which keeps the runs, so that a call with more seeds
    executes the new ones alone, and all of a class without a `version`; without `out` they go with the
    returned `Study`. A folder with other runs, as of another version of a class, is refused; `prune`
    removes these. `progress` shows a bar of tqdm in terminals and notebooks; by default where tqdm is
    installed.
    """
    chosen = list(planners)
    classes = [one for one in chosen if not isinstance(one, str)]
    names = [one if isinstance(one, str) else one.name for one in chosen]
    if len(set(names)) < 2 or len(set(names)) < len(names):
        raise _maes.BadInput(f"planners = {names}: expected two or more different ones")
    if isinstance(seeds, (str, bytes)) or not isinstance(seeds, Iterable):
        raise _maes.BadInput(f"seeds = {seeds!r}: expected whole numbers, such as range(1, 7)")
    numbers = [seed_of(seed) for seed in seeds]
    wanted = scenario if isinstance(scenario, Scenario) else Scenario(scenario)
    wanted = wanted.replace(**keys)
    # The plan has a folder of its own, from which its paths would start.
    if file := wanted.to_dict()["map"].get("file"):
        wanted = wanted.replace(map__file=os.path.abspath(os.path.join(wanted._native.paths_from, file)))
    temporary = tempfile.TemporaryDirectory(prefix="maes-study-") if out is None else None
    folder = Path(temporary.name if temporary is not None else os.fspath(out or ""))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.scenario.toml").write_text(wanted.to_toml(), encoding="utf-8")
    plan = folder / "study.toml"
    # What JSON writes of these is TOML as well, if it escapes no surrogates.
    plan.write_text(
        f"title = {_text(' and '.join(names))}\n"
        f"seeds = {json.dumps(numbers)}\n"
        'compare = "agents.controller"\n'
        f"primary = {_text(primary)}\n"
        'scenario = "study.scenario.toml"\n'
        f'[axes]\n"agents.controller" = {_text(names)}\n',
        encoding="utf-8",
    )
    shown = _has_tqdm() if progress is None else progress
    done = batch(plan, folder, jobs=jobs, controllers=classes, executor=executor, progress=shown, prune=prune)
    return Study(done, names, temporary)


def _text(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def _has_tqdm() -> bool:
    try:
        import tqdm.auto  # noqa: F401
    except ImportError:
        return False
    return True
