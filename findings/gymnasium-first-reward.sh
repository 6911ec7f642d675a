#!/usr/bin/env bash
# gymnasium 1.4.0: the first reward of a run is made 70 times larger.
#
# Expected: NormalizeReward scales rewards by the spread of their discounted sum, "approximately
# fixed variance"; a constant reward of 1 stays near one size.
# Seen: the estimate of the variance starts from one sample, so the first reward is divided by
# sqrt(0.0002): 1 becomes 70.7, then 2.2, 1.4, 1.1. With -1 it is -70.7. After `reset` the estimate
# goes on, so it is one reward of each run (and of each worker), not of each episode.
# So: the sum of the first episode is worthless, and one gradient step may be ruined; run one
# episode before learning, or clip after normalising.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check gymnasium==1.4.0 array-api-compat==1.16.0
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.wrappers import NormalizeReward

class World(gymnasium.Env):
    observation_space = action_space = Box(-1, 1, (1,), np.float32)
    def __init__(self, reward): self.reward = reward
    def reset(self, seed=None, options=None):
        self.steps = 0
        return np.zeros(1, np.float32), {}
    def step(self, action):
        self.steps += 1
        return np.zeros(1, np.float32), self.reward, self.steps == 5, False, {}

found = {}
for reward in (1.0, -1.0):
    world = NormalizeReward(World(reward), gamma=0.9)
    for episode in range(2):
        world.reset()
        found[reward, episode] = [round(float(world.step(np.zeros(1))[1]), 1) for _ in range(5)]
        print(f"reward {reward}, episode {episode}: {found[reward, episode]}")
if found[1.0, 0][0] != 70.7 or found[-1.0, 0][0] != -70.7 or max(found[1.0, 0][1:]) > 3:
    sys.exit("changed: the first episode is %s" % found[1.0, 0])
if max(found[1.0, 1]) > 2:
    sys.exit("changed: the second episode is %s" % found[1.0, 1])
PY
