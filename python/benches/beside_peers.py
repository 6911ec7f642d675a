"""Agent steps per second of `maes.envs.Worlds` beside VMAS and IR-SIM, in turns; see docs/python.md.

    pip install torch vmas ir-sim              # beside the package `maes`
    python python/benches/beside_peers.py [rounds]

The task is as close as they allow: 16 environments of 4 agents among obstacles, each with a range
sensor, a random velocity for every agent, decisions at 5 Hz of sim time (VMAS: 10 Hz). What differs is in the
docs: VMAS and IR-SIM are planar and keep no map.
"""

import os
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from statistics import median

import numpy as np

from maes.envs import Worlds

ENVIRONMENTS, AGENTS, STEPS, RAYS = 16, 4, 200, 12

IR_SIM_WORLD = """
world: {height: 50, width: 50, step_time: 0.2, sample_time: 0.2}
robot:
  - number: 4
    distribution: {name: manual}
    kinematics: {name: diff}
    shape: {name: circle, radius: 0.5}
    vel_min: [-1, -1]
    vel_max: [1, 1]
    state: [[5, 5, 0], [45, 5, 0], [5, 45, 0], [45, 45, 0]]
    sensors: [{name: lidar2d, range_min: 0, range_max: 20, angle_range: 6.28, number: RAYS}]
obstacle:
  - number: 20
    distribution: {name: random, range_low: [10, 10, -3.14], range_high: [40, 40, 3.14]}
    shape: [{name: circle, radius: 2.0}]
"""


def of_maes(crop_radius):
    """16 caves of 50^3 cells."""
    worlds = Worlds(ENVIRONMENTS, agents=AGENTS, size=50, period_s=0.2, crop_radius=crop_radius)
    actions = np.random.default_rng(1).uniform(-1, 1, (STEPS, ENVIRONMENTS, AGENTS, 4)).astype(np.float32)

    def steps():
        for action in actions:
            worlds.step(action)

    return steps


def of_vmas(environments):
    """Environments of the scenario `navigation` with its LiDAR, as one batch; a step is 0.1 s."""
    import torch
    import vmas

    keys = {"n_agents": AGENTS, "collisions": True, "n_lidar_rays": RAYS}
    batch = vmas.make_env("navigation", environments, device="cpu", continuous_actions=True, seed=1, **keys)
    batch.reset()
    actions = torch.rand(STEPS // 10, AGENTS, environments, 2) * 2 - 1

    def steps():
        for action in actions:
            batch.step(list(action))

    return steps


def of_ir_sim():
    """16 environments, one after the other."""
    import irsim

    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder) / "world.yaml"
        world.write_text(IR_SIM_WORLD.replace("RAYS", str(RAYS)))
        environments = [irsim.make(str(world), headless=True, log_level="ERROR") for _ in range(ENVIRONMENTS)]
    actions = np.random.default_rng(1).uniform(-1, 1, (STEPS // 10, ENVIRONMENTS, AGENTS, 2))

    def steps():
        for action in actions:
            for environment, of_agents in zip(environments, action, strict=True):
                environment.step([one[:, None] for one in of_agents])
                for agent in range(AGENTS):
                    environment.get_lidar_scan(agent)

    return steps


def main():
    """Print the figures."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    runners = {
        "maes, 16 environments": (of_maes(5), STEPS, ENVIRONMENTS),
        f"VMAS {version('vmas')}, 16 environments": (of_vmas(ENVIRONMENTS), STEPS // 10, ENVIRONMENTS),
        f"VMAS {version('vmas')}, 1024 environments": (of_vmas(1024), STEPS // 10, 1024),
        f"IR-SIM {version('ir-sim')}, 16 environments": (of_ir_sim(), STEPS // 10, ENVIRONMENTS),
    }
    rates = {name: [] for name in runners}
    for _ in range(rounds):
        for name, (run, steps, environments) in runners.items():
            start = time.perf_counter()
            run()
            rates[name].append(steps * environments * AGENTS / (time.perf_counter() - start))
    ours = rates["maes, 16 environments"]
    print(f"{os.cpu_count()} cores, {rounds} rounds in turns, agent steps per second:")
    for name, of in rates.items():
        ratio = median(mine / theirs for mine, theirs in zip(ours, of, strict=True))
        print(f"{name}: {median(of):.0f} ({min(of):.0f} to {max(of):.0f}); the first is {ratio:.2f} times as fast")


if __name__ == "__main__":
    main()
