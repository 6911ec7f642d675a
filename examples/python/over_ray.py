"""A plan over Ray: each run is a task of the cluster, here of one on this machine.

    python examples/python/over_ray.py plan.toml out/mine             # needs `pip install ray`

With `ray.init(address="auto")`, machines of a running cluster execute the runs. They need the
package `maes` and the plan at the same path.
"""

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

import maes
import ray


class RayExecutor(Executor):
    """Ray's tasks behind the interface of `concurrent.futures`."""

    def __init__(self) -> None:
        # `maes.batch` submits the runs of lost workers again, and counts the attempts.
        self._call = ray.remote(num_cpus=1, max_retries=0)(lambda call, *values, **named: call(*values, **named))

    def submit(self, call: Callable[..., Any], /, *values: Any, **named: Any) -> Future[Any]:
        return self._call.remote(call, *values, **named).future()


@contextmanager
def executor(workers: int) -> Iterator[Executor]:
    """Workers on this machine, each a process that executes one run at a time."""
    ray.init(num_cpus=workers, include_dashboard=False)
    try:
        yield RayExecutor()
    finally:
        ray.shutdown()


if __name__ == "__main__":
    plan, out = sys.argv[1:]
    with executor(workers=2) as pool:
        print(maes.batch(plan, out, executor=pool))
