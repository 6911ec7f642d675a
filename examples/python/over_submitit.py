"""A plan over Slurm by submitit: each run is a job.

    pip install submitit
    python examples/python/over_submitit.py plan.toml out/mine [local]

With `local`, and where there is no Slurm, jobs are processes on this machine. Lost jobs are
submitted again if Slurm keeps accounts, from which submitit learns of them. A queue suits runs of
minutes and more; for thousands of short runs `maes batch` writes jobs that execute many of them
(docs/experiments.md). The machines need the package `maes`, and the plan and the folder of the jobs
at the same paths.
"""

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

import maes
import submitit


class SubmititExecutor(Executor):
    """Jobs of submitit behind the interface of `concurrent.futures`: a thread waits for each job,
    and at most `jobs` are in the queue at a time."""

    def __init__(self, cluster: submitit.AutoExecutor, jobs: int) -> None:
        self._cluster = cluster
        self._lock = Lock()
        self._threads = ThreadPoolExecutor(jobs)

    def submit(self, call: Callable[..., Any], /, *values: Any, **named: Any) -> Future[Any]:
        return self._threads.submit(self._execute, call, values, named)

    def _execute(self, call: Callable[..., Any], values: tuple[Any, ...], named: dict[str, Any]) -> Any:
        with self._lock:
            job = self._cluster.submit(call, *values, **named)
        return job.result()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._threads.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def executor(workers: int, folder: str = "submitit", cluster: str | None = None) -> Iterator[Executor]:
    """Jobs that keep their logs in `folder`: of Slurm where it is installed, else processes on this
    machine (`cluster="local"`)."""
    jobs = submitit.AutoExecutor(folder=Path(folder).resolve(), cluster=cluster)
    jobs.update_parameters(timeout_min=60, cpus_per_task=1)
    with SubmititExecutor(jobs, workers) as pool:
        yield pool


if __name__ == "__main__":
    plan, out, *cluster = sys.argv[1:]
    with executor(workers=2, cluster=cluster[0] if cluster else None) as pool:
        print(maes.batch(plan, out, executor=pool))
