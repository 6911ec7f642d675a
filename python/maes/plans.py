"""Plans of many runs (docs/experiments.md), in this process or over an executor."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any

from . import _maes
from ._frames import frame
from .controllers import Controller, registered


class Batch:
    """The runs of a plan in a folder, which is read at each use: a later call may replace them."""

    __slots__ = ("failures", "folder")

    def __init__(self, folder: str | os.PathLike[str], failures: dict[str, str] | None = None) -> None:
        self.folder = Path(folder)
        """The folder with `runs.csv`, `series.csv`, `agents.csv` and a file for each run."""
        self.failures = dict(failures or {})
        """The reason of each run that has failed, by its id."""

    def columns(self, table: str = "runs") -> dict[str, list[Any]]:
        """The columns of the table "runs", "series", "agents" or "verdicts" (docs/python.md)."""
        return _maes.stored_table(os.fspath(self.folder), table)

    def frame(self, table: str = "runs", library: str | None = None) -> Any:
        """The same as a data frame of polars or pandas."""
        return frame(self.columns(table), library)

    def report(self) -> Path:
        """Write the report of `maes report` with its figures as SVG; returns its page."""
        return Path(_maes.write_report(os.fspath(self.folder)))

    def __repr__(self) -> str:
        return f"Batch({os.fspath(self.folder)!r}, {len(self.failures)} failures)"


class _Progress:
    """Counts runs, shows them with tqdm if that is asked for, and keeps the failures."""

    def __init__(self, is_shown: bool) -> None:
        self.failures: dict[str, str] = {}
        self._bar: Any = None
        self._new_bar: Any = None
        if is_shown:
            try:
                from tqdm.auto import tqdm
            except ImportError as error:
                raise ImportError("progress=True needs tqdm: pip install 'maes[progress]'") from error
            self._new_bar = tqdm

    def __call__(self, event: str, *details: Any) -> None:
        if event == "started":
            if self._new_bar is not None:
                self._bar = self._new_bar(total=details[0], unit="run")
            return
        if event == "failed":
            self.failures[details[0]] = details[1]
        if self._bar is not None:
            self._bar.update()
            if self.failures:
                self._bar.set_postfix(failed=len(self.failures))

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _plan(file: str, known: _maes.Controllers) -> _maes.NativePlan:
    path = Path(file)
    return _maes.NativePlan.parse(file, path.read_text(encoding="utf-8"), os.fspath(path.parent), known)


def _run_part(file: str, id: str, classes: list[type[Controller]]) -> tuple[bytes, bytes]:
    """Execute a run of a plan in a worker; return the files with its record and its scenario."""
    known = registered(classes)
    native, progress = _plan(file, known), _Progress(False)
    if id not in [one for one, _, _ in native.runs()]:
        raise _maes.BadInput(
            f"{file}: has no run {id} in the worker; expected the same files, the same versions of controllers "
            f"and the same build ({_maes.BUILD})"
        )
    with tempfile.TemporaryDirectory() as folder:
        opened = native.open(folder, known, 1, False)
        _maes.execute_plan(native, opened, only=[id], report=progress)
        opened.close()
        if progress.failures:
            raise _maes.RunFailed(progress.failures[id])
        runs = Path(folder) / "runs"
        return (runs / f"{id}.json").read_bytes(), (runs / f"{id}.toml").read_bytes()


def batch(
    plan: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    jobs: int | None = None,
    controllers: Sequence[type[Controller]] = (),
    executor: Executor | None = None,
    progress: bool = False,
    prune: bool = False,
    attempts: int = 3,
) -> Batch:
    """Execute the runs of a plan that the folder `out` does not have yet, and again those of classes
    without a `version`, which replace those of the call before.

    `controllers` are classes that the plan names beside the built-in ones. `jobs` runs are executed at a
    time, one for each core by default; Python controllers share the GIL, so that an `executor` of
    processes is faster for them. With an executor of `concurrent.futures` each run is a task of
    its own, which is submitted up to `attempts` times if its worker dies; workers read the plan
    from the same path. `progress` shows a bar of tqdm, and raises an ImportError without it.

    A folder with runs that are not of this plan, or of another version of a class, is refused before
    anything is executed; `prune` removes them.
    """
    file, classes = os.fspath(plan), list(controllers)
    known = registered(classes)
    native = _plan(file, known)
    shown = _Progress(progress)
    cores = jobs if jobs is not None else len(os.sched_getaffinity(0))
    folder = native.open(os.fspath(out), known, cores, prune)
    try:
        if executor is not None:
            _distribute(native, file, folder, classes, executor, shown, attempts)
        if shown.failures:
            folder.write_tables()
        else:
            # After an executor it finds all records, and only writes the tables.
            _maes.execute_plan(native, folder, only=[], report=shown)
    finally:
        folder.close()
        shown.close()
    return Batch(out, shown.failures)


def _distribute(
    native: _maes.NativePlan,
    file: str,
    folder: _maes.PlanFolder,
    classes: list[type[Controller]],
    executor: Executor,
    shown: _Progress,
    attempts: int,
) -> None:
    """Execute the missing runs as tasks of an executor, and store their records."""
    missing = folder.missing(native)
    shown("started", len(missing))
    for attempt in range(attempts):
        tasks = {executor.submit(_run_part, file, id, classes): id for id in missing}
        missing = []
        for task in as_completed(tasks):
            id = tasks[task]
            try:
                record, scenario = task.result()
            except Exception as error:
                is_final = isinstance(error, (_maes.RunFailed, _maes.BadInput))
                if not is_final and attempt + 1 < attempts:
                    missing.append(id)
                    continue
                reason = str(error) if is_final else f"{type(error).__name__}: {error}"
                folder.store_failure(native, id, reason)
                shown("failed", id, reason)
            else:
                folder.store_run(id, record, scenario)
                shown("completed", id)
        if not missing:
            return
