"""A plan over Dask: each run is a task of a worker, here of a cluster on this machine.

    python examples/python/over_dask.py plan.toml out/mine      # needs `pip install distributed`

With the address of a scheduler in `Client`, workers of other machines execute the runs. They need
the package `maes` and the plan at the same path.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

import maes
from distributed import Client, LocalCluster


@contextmanager
def executor(workers: int) -> Iterator[Executor]:
    """Workers on this machine, each a process that executes one run at a time."""
    cluster = LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster, Client(cluster) as client, client.get_executor() as pool:
        yield pool


if __name__ == "__main__":
    plan, out = sys.argv[1:]
    with executor(workers=2) as pool:
        print(maes.batch(plan, out, executor=pool))
