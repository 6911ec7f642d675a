"""A plan over the executors of examples/python, one of whose workers is killed in the middle of it:
its tables are the bytes of the plan without an executor, wall times left out.

    python tests/executors.py dask|ray|submitit EXAMPLES FOLDER

The first task that starts on a worker never ends, and writes the process id of its worker. As soon
as another worker has returned a run, this process kills the first one, with SIGKILL. So a plan only
ends if its run is executed again.
"""

import importlib
import os
import signal
import sys
from concurrent.futures import Executor
from pathlib import Path

import maes

RUNS = 6
PLAN = f"""
seeds = "1..{RUNS}"
[scenario]
duration_s = 60.0
stop_when_explored = false
[scenario.map]
kind = "spheres"
size = 40
[scenario.map.spheres]
radius_max = 5
[scenario.agents]
count = 2
controller = "nearest-frontier"
"""
TABLES = ("runs.csv", "series.csv", "agents.csv")


def hanging_once(call, victim):
    """`call`, which in the first process that calls it never returns."""

    # A closure, which reaches workers as code: they cannot import this file.
    def task(*values):
        import os
        import threading

        try:
            # Complete before it has its name: the other process never reads a part of it.
            partial = f"{victim}.{os.getpid()}"
            with open(partial, "w") as file:
                file.write(str(os.getpid()))
            os.link(partial, victim)
        except FileExistsError:
            return call(*values)
        threading.Event().wait()

    return task


class KillsWorker(Executor):
    """Kills the worker of the task that never ends when another task has ended."""

    def __init__(self, pool, victim):
        self.pool = pool
        self.victim = victim
        self.killed = []
        self.submitted = []

    def submit(self, call, /, *values):
        self.submitted.append(values[1])
        future = self.pool.submit(hanging_once(call, os.fspath(self.victim)), *values)
        future.add_done_callback(self._kill)
        return future

    def _kill(self, future):
        if not self.killed:
            assert future.exception() is None, future.exception()
            self.killed.append(int(self.victim.read_text()))
            assert self.killed[0] != os.getpid()
            os.kill(self.killed[0], signal.SIGKILL)


def without_wall_times(file):
    """The columns before those of wall times, which come last."""
    rows = [line.split(b",") for line in file.read_bytes().splitlines()]
    kept = next((n for n, head in enumerate(rows[0]) if head.startswith(b"wall_")), len(rows[0]))
    return [row[:kept] for row in rows]


def main(name, examples, folder):
    folder = Path(folder)
    plan = folder / "plan.toml"
    plan.write_text(PLAN)
    maes.batch(plan, folder / "here", jobs=1)
    sys.path.insert(0, examples)
    example = importlib.import_module(f"over_{name}")
    keys = {"folder": folder / "jobs", "cluster": "local"} if name == "submitit" else {}
    with example.executor(workers=2, **keys) as pool:
        killer = KillsWorker(pool, folder / "victim")
        batch = maes.batch(plan, folder / "there", executor=killer)
    assert not batch.failures, batch.failures
    assert len(killer.killed) == 1, "a worker was killed"
    for table in TABLES:
        here, there = (without_wall_times(folder / of / table) for of in ("here", "there"))
        assert len(here) > 1 and here == there, f"{table} differs"
    runs = batch.columns()
    assert len(runs["id"]) == RUNS and min(runs["decisions"]) > 50, runs
    print(f"{name}: {RUNS} runs, {len(killer.submitted)} submitted, 1 worker killed, same tables")


if __name__ == "__main__":
    main(*sys.argv[1:])
