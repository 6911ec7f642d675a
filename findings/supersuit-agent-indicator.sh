#!/usr/bin/env bash
# SuperSuit 3.11.0: the one-hot indicator of an agent is 100-hot.
#
# Expected: `agent_indicator_v0` appends "a 1-hot vector" with the agent's number to a flat
# observation (its documentation).
# Seen: the hot entry is the highest bound of the observation space: 100 for positions up to 100 m,
# and for bounds of infinity the indicator is 1.
# So: a network for several agents gets one input a hundred times larger than the others; normalise
# after the indicator, not before, or append it oneself. Changing the map's size changes the
# indicator.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    supersuit==3.11.0 pettingzoo==1.27.0 gymnasium==1.4.0 numpy==2.4.6
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import numpy as np
import supersuit
from gymnasium import spaces
from pettingzoo import ParallelEnv

class Two(ParallelEnv):
    metadata, render_mode = {"name": "two", "render_modes": []}, None
    possible_agents = ["agent_0", "agent_1"]

    def __init__(self, high):
        self.space, self.actions = spaces.Box(-high, high, (1,), np.float32), spaces.Discrete(2)

    def observation_space(self, agent):
        return self.space

    def action_space(self, agent):
        return self.actions

    def reset(self, seed=None, options=None):
        self.agents = self.possible_agents[:]
        return {a: np.array([0.5], np.float32) for a in self.agents}, {a: {} for a in self.agents}

found = {}
for high in (1.0, 100.0, np.inf):
    observations, _ = supersuit.agent_indicator_v0(Two(high)).reset(seed=1)
    found[high] = observations["agent_1"].tolist()
    print(f"bounds of {high}: agent_1 sees 0.5 as {found[high]}")
if found[1.0] != [0.5, 0.0, 1.0] or found[100.0] != [0.5, 0.0, 100.0]:
    sys.exit("changed: observations are %s" % found)
if found[np.inf] != [0.5, 0.0, 1.0]:
    sys.exit("changed: without bounds it is %s" % found[np.inf])
PY
