"""A plan over Parsl: each run is a task of a worker, here of this machine.

    python examples/python/over_parsl.py plan.toml out/mine      # needs `pip install parsl`

With another `provider` of `HighThroughputExecutor` workers are jobs of a cluster. They need the
package `maes` and the plan at the same path.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

import maes
from parsl.concurrent import ParslPoolExecutor
from parsl.config import Config
from parsl.executors import HighThroughputExecutor
from parsl.providers import LocalProvider


@contextmanager
def executor(workers: int, folder: str = "parsl") -> Iterator[Executor]:
    """Workers on this machine, each a process that executes one run at a time. Logs are in `folder`."""
    local = HighThroughputExecutor(
        address="127.0.0.1", max_workers_per_node=workers, provider=LocalProvider()
    )
    with ParslPoolExecutor(Config(executors=[local], run_dir=str(Path(folder)), usage_tracking=0)) as pool:
        yield pool


if __name__ == "__main__":
    plan, out = sys.argv[1:]
    with executor(workers=2) as pool:
        print(maes.batch(plan, out, executor=pool))
