"""A plan over Slurm by submitit: each run is a job.

    pip install submitit
    python examples/python/over_submitit.py plan.toml out/mine [local]

With `local`, and where there is no Slurm, jobs are processes on this machine. Lost jobs are
submitted again; without accounting in Slurm, of which submitit 1.5 complains every few seconds for
each job, the queue says which are lost. A queue suits runs of minutes and more; for thousands of short runs `maes batch` writes jobs that execute many of them
(docs/experiments.md). The machines need the package `maes`, and the plan and the folder of the jobs
at the same paths.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

import maes
import submitit


QUEUE_PERIOD_S = 5.0
# A shared folder may show a result later than the queue shows the end of its job.
RESULT_DELAY_S = 30.0


def has_accounting() -> bool:
    """Whether jobs are in no Slurm, or in one that keeps accounts."""
    if shutil.which("sacct") is None:
        return True
    return subprocess.run(["sacct", "--allocations"], capture_output=True, check=False).returncode == 0


def await_by_queue(job: submitit.Job[Any]) -> None:
    """Return when a job of Slurm has a result; raise a RuntimeError if it has ended without."""
    result = job.paths.result_pickle
    left_at = None
    while not result.exists():
        command = ["squeue", "--noheader", f"--jobs={job.job_id}"]
        listed = subprocess.run(command, capture_output=True, text=True, check=False)
        # A server that does not answer knows nothing of the job; an unknown job is an error too.
        is_gone = "Invalid job id" in listed.stderr or (listed.returncode == 0 and not listed.stdout)
        left_at = (left_at or time.monotonic()) if is_gone else None
        if left_at is not None and time.monotonic() - left_at > RESULT_DELAY_S:
            raise RuntimeError(f"job {job.job_id} has left the queue without a result: {job.paths.stderr}")
        time.sleep(QUEUE_PERIOD_S)


class SubmititExecutor(Executor):
    """Jobs of submitit behind the interface of `concurrent.futures`: a thread waits for each job,
    and at most `jobs` are in the queue at a time."""

    def __init__(self, cluster: submitit.AutoExecutor, jobs: int) -> None:
        self._cluster = cluster
        self._has_accounting = cluster.cluster != "slurm" or has_accounting()
        self._lock = Lock()
        self._threads = ThreadPoolExecutor(jobs)

    def submit(self, call: Callable[..., Any], /, *values: Any, **named: Any) -> Future[Any]:
        return self._threads.submit(self._execute, call, values, named)

    def _execute(self, call: Callable[..., Any], values: tuple[Any, ...], named: dict[str, Any]) -> Any:
        with self._lock:
            job = self._cluster.submit(call, *values, **named)
        if not self._has_accounting:
            await_by_queue(job)
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
