#!/usr/bin/env bash
# SuperSuit 3.11.0: when an agent ends, the observations come in another order than the rewards of
# the same step.
#
# Expected: a wrapper that clips rewards leaves the dict of observations as the environment made
# it: agent 0, agent 1, as before.
# Seen (clip_reward_v0; agent_indicator_v0, normalize_obs_v0, nan_zeros_v0 and dtype_v0 alike): in
# the step in which agent 0 terminates its observations are in the order 1, 0 and its rewards in
# the order 0, 1.
# So: `np.stack(list(obs.values()))` exchanges the agents in exactly one step of an episode, the
# last one of the first who ends. Always index by `possible_agents`.
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
    space, actions = spaces.Box(-100, 100, (2,), np.float32), spaces.Discrete(2)

    def observation_space(self, agent):
        return self.space

    def action_space(self, agent):
        return self.actions

    def reset(self, seed=None, options=None):
        self.agents, self.time = self.possible_agents[:], 0
        return self.all(lambda a: self.see(a)), self.all(lambda a: {})

    def see(self, agent):
        return np.array([int(agent[-1]), self.time], np.float32)

    def all(self, value):
        return {agent: value(agent) for agent in self.agents}

    def step(self, actions):
        self.time += 1
        ended = self.all(lambda a: a == "agent_0" and self.time == 2)
        result = self.all(self.see), self.all(lambda a: 1.0), ended, self.all(lambda a: False), self.all(lambda a: {})
        self.agents = [a for a in self.agents if not ended[a]]
        return result

def orders(wrap):
    env = wrap(Two())
    env.reset(seed=1)
    for _ in range(2):
        observations, rewards, ended, *_ = env.step({agent: 0 for agent in env.agents})
        yield "".join(a[-1] for a in observations) + "/" + "".join(a[-1] for a in rewards)

found = {
    "unwrapped": list(orders(lambda env: env)),
    "clip_reward": list(orders(lambda env: supersuit.clip_reward_v0(env, -1, 1))),
    "normalize_obs": list(orders(lambda env: supersuit.normalize_obs_v0(env))),
}
for name, steps in found.items():
    print(f"{name}: observations/rewards of the first step {steps[0]}, of the one in which agent_0 ends {steps[1]}")
if found["unwrapped"] != ["01/01", "01/01"]:
    sys.exit("changed: the plain environment gives %s" % found["unwrapped"])
if found["clip_reward"] != ["01/01", "10/01"] or found["normalize_obs"] != ["01/01", "10/01"]:
    sys.exit("changed: orders are %s" % found)
PY
