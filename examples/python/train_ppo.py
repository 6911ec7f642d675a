"""Trains a policy by PPO that chooses frontiers for a team, and compares it on unseen maps.

    pip install 'maes[env,plot]' stable-baselines3
    python examples/python/train_ppo.py out/ppo --minutes 30

The agents of all worlds share one policy. It sees what an agent sees: its state, every eighth of
its 256 nearest frontiers, and the agents in contact. It names the frontier that the agent goes to,
and is asked again when the agent is there or a second has passed at rest. The reward is the share
of the free cells, in percent, that the team sees for the first time and that the agent itself does,
half of each, less a little for the time. The folder gets the policy, `curve.csv`, `curve.svg` and `evaluation.csv`: the
policy before and after training, random choices, the nearest frontier by straight distance, and
`rbw` as a run, on maps of seeds that training does not use.
"""

import argparse
import csv
import time
from pathlib import Path
from statistics import mean

import matplotlib.pyplot as plt
import numpy as np
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

import maes
from maes.envs import Worlds

TEAM = {"agents": 3, "size": 40, "duration": 300.0, "lidar__range_m": 6.0}
PERIOD_S = 1.0
NEAREST, EVERY = 256, 8
FRONTIERS = NEAREST // EVERY
WORLDS = 16
TRAINING_SEED = 100_000
HELD_OUT = range(1, 41)
SCALE_M = 20.0
TARGET = 0.9


def worlds(count, seed):
    """Worlds of the scenario in which agents choose frontiers."""
    chosen = {"period_s": PERIOD_S, "actions": "frontier", "frontiers": NEAREST, "crop_radius": 0}
    return Worlds(count, seed=seed, **chosen, **TEAM)


def rows(shown):
    """What the policy sees, a row for each agent of each world; places in body axes."""
    places = np.concatenate([shown["contacts"], shown["frontiers"][:, :, ::EVERY]], axis=2)
    x, y, z, is_there = np.moveaxis(places, -1, 0)
    cosine, sine = shown["own"][..., 6:7], shown["own"][..., 7:8]
    ahead, left = cosine * x + sine * y, cosine * y - sine * x
    places = np.stack([ahead / SCALE_M, left / SCALE_M, z / SCALE_M, is_there], axis=-1)
    worlds, agents = shown["own"].shape[:2]
    parts = (part.reshape(worlds * agents, -1) for part in (shown["own"], places))
    return np.concatenate([*parts], axis=1, dtype=np.float32)


def goals(choices, shown):
    """The actions: the chosen frontiers for the agents at rest; the others continue."""
    is_active = shown["own"][..., 9] > 0
    chosen = EVERY * np.reshape(choices, is_active.shape)
    return np.where(is_active, NEAREST, chosen)[..., None].astype(np.float32)


class Team(VecEnv):
    """`Worlds` as an environment of stable-baselines3: each agent of each world is one of its."""

    def __init__(self):
        self.worlds = worlds(WORLDS, TRAINING_SEED)
        width = rows(self.worlds.observe()).shape[1]
        space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        super().__init__(WORLDS * self.worlds.agents, space, spaces.Discrete(FRONTIERS))
        self.explored = np.zeros(WORLDS)
        self.times_s = np.zeros(WORLDS)
        self.reached_s = np.full(WORLDS, TEAM["duration"])
        self.ended = []

    def reset(self):
        self.explored[:], self.times_s[:], self.reached_s[:] = 0.0, 0.0, TEAM["duration"]
        return rows(self.worlds.reset())

    def step_async(self, actions):
        self.actions = goals(actions, self.worlds.observe())

    def step_wait(self):
        shown, _, is_explored, is_over, details = self.worlds.step(self.actions)
        of_team = (details["explored"] - self.explored)[:, None]
        gains = 50.0 * of_team + 50.0 * details["explored_gain"] - 0.1
        done = is_explored | is_over
        self.times_s += PERIOD_S
        earlier_s = np.minimum(self.reached_s, self.times_s)
        self.reached_s = np.where(details["explored"] < TARGET, self.reached_s, earlier_s)
        self.ended += self.reached_s[done].tolist()
        self.explored = np.where(done, 0.0, details["explored"])
        self.times_s[done], self.reached_s[done] = 0.0, TEAM["duration"]
        done = np.repeat(done, self.worlds.agents)
        return rows(shown), gains.reshape(-1).astype(np.float32), done, [{} for _ in range(self.num_envs)]

    def close(self):
        self.worlds.close()

    def get_attr(self, attr_name, indices=None):
        return [None] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError

    def env_method(self, method_name, *args, indices=None, **kwargs):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * self.num_envs


def evaluated(choose):
    """The explored share over time on each held-out map: (maps, seconds)."""
    held_out = worlds(len(HELD_OUT), HELD_OUT[0])
    shares, active = [], np.ones(len(HELD_OUT), bool)
    while active.any():
        shown = held_out.observe()
        _, _, is_explored, is_over, details = held_out.step(goals(choose(shown), shown), begin_again=False)
        active &= ~(is_explored | is_over)
        shares.append(np.maximum(details["explored"], shares[-1]) if shares else details["explored"])
    held_out.close()
    return np.array(shares).T


def of_rbw():
    """The same for runs of `rbw`."""
    shares = []
    for seed in HELD_OUT:
        series = maes.run(seed=seed, controller="rbw", **TEAM).columns("series")
        seconds = np.arange(PERIOD_S, TEAM["duration"] + PERIOD_S / 2, PERIOD_S)
        shares.append(np.interp(seconds, series["t_s"], series["explored"]))
    return np.array(shares)


def figures(shares):
    """Explored share at 60 s and at the end, and the mean time to the target, the duration where it
    is not reached."""
    reached = [int(np.argmax(row >= TARGET)) + 1 if row.max() >= TARGET else TEAM["duration"] for row in shares]
    at = min(60, shares.shape[1])
    return mean(shares[:, at - 1]), mean(shares[:, -1]), mean(reached), sum(row.max() >= TARGET for row in shares)


class Curve(BaseCallback):
    """Stops after a time, and keeps the mean time to the target of the worlds that have ended."""

    def __init__(self, seconds):
        super().__init__()
        self.rows, self.seconds = [], seconds

    def _on_training_start(self):
        self.start = time.perf_counter()

    def _on_step(self):
        return time.perf_counter() - self.start < self.seconds

    def _on_rollout_end(self):
        ended = self.training_env.ended
        if len(ended) >= 2 * WORLDS:
            self.training_env.ended = []
            self.rows.append((self.num_timesteps, time.perf_counter() - self.start, mean(ended)))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=30.0)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    team = Team()
    model = PPO("MlpPolicy", team, n_steps=128, batch_size=1024, gamma=0.97, ent_coef=0.01, seed=1, device="cpu")

    def of_policy(shown):
        return model.predict(rows(shown), deterministic=True)[0]

    random = np.random.default_rng(1)
    results = {
        "rbw": of_rbw(),
        "random frontier": evaluated(lambda shown: random.integers(FRONTIERS, size=shown["own"].shape[:2])),
        "nearest frontier": evaluated(lambda shown: np.zeros(shown["own"].shape[:2])),
        "policy before training": evaluated(of_policy),
    }
    curve = Curve(arguments.minutes * 60)
    model.learn(10**9, callback=curve)
    model.save(arguments.folder / "policy")
    results["policy after training"] = evaluated(of_policy)
    with open(arguments.folder / "curve.csv", "w", newline="") as file:
        csv.writer(file).writerows([("agent_steps", "wall_s", "t90_s"), *curve.rows])
    with open(arguments.folder / "evaluation.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("controller", "explored_60_s", "explored_end", "t90_s", "maps_90", "maps"))
        for name, shares in results.items():
            row = figures(shares)
            writer.writerow((name, *(f"{value:.3f}" for value in row[:3]), row[3], len(shares)))
            print(f"{name}: {row[0]:.1%} after 60 s, {row[1]:.1%} at the end, 90 % after {row[2]:.0f} s")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    # A short training has no mean yet.
    if curve.rows:
        steps, _, times_s = zip(*curve.rows, strict=True)
        left.plot(np.array(steps) / 1e6, times_s, lw=0.8)
    left.set(xlabel="agent steps in training (millions)", ylabel="time to 90 % (s), mean of 32 worlds")
    for name, shares in results.items():
        right.plot(np.arange(1, shares.shape[1] + 1) * PERIOD_S, shares.mean(0), label=name, lw=1)
    right.set(xlabel="sim time (s)", ylabel="explored share, unseen maps")
    right.legend(fontsize="x-small")
    figure.savefig(arguments.folder / "curve.svg")


if __name__ == "__main__":
    main()
