"""Measures the figures of docs/python.md; `maes` of the same build is on the path.

    python python/benches/figures.py
"""

import subprocess
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

import maes
from maes.envs import Worlds
from maes.node import load

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/python/nearest_frontier.py"


def seconds(work):
    """Wall time of a call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def command():
    """The same run by the command."""
    subprocess.run(["maes", "run", "--transport", "memory", "--seed", "3"], check=True, capture_output=True)


def main():
    """Print the figures."""
    imports = [sys.executable, "-c", "import maes"], [sys.executable, "-c", "import numpy"]
    pairs = [[seconds(lambda one=one: subprocess.run(one, check=True)) for one in imports] for _ in range(7)]
    print("import maes, import numpy alone: %.3f s, %.3f s" % tuple(map(median, zip(*pairs))))
    pairs = [(seconds(lambda: maes.run(seed=3)), seconds(command)) for _ in range(7)]
    here, there = map(median, zip(*pairs))
    ratio = median(a / b for a, b in pairs)
    print(f"maes.run {here:.3f} s, maes run {there:.3f} s (with its start), median ratio {ratio:.3f}")
    port = load(f"{EXAMPLE}:NearestFrontier")
    result = maes.run(controller=port, agents=5, size=100)
    print(f"nearest-frontier in Python, 100^3, 5 agents: {result.metrics['wall']['real_time_factor']:.0f} x real time")
    rng = np.random.default_rng(1)
    rates = []
    for _ in range(5):
        worlds = Worlds(16, agents=4, size=50, period_s=0.2)
        actions = rng.uniform(-1, 1, (1000, 16, 4, 4)).astype(np.float32)
        rates.append(1000 * 64 / seconds(lambda: [worlds.step(one) for one in actions]))
    print(f"16 worlds of 4 agents, 200 s: {median(rates):.0f} ({min(rates):.0f} to {max(rates):.0f}) agent-steps/s")


if __name__ == "__main__":
    main()
