#!/usr/bin/env bash
# SuperSuit 3.11.0: with `black_death` the last step of an episode looks like any other, and one
# more follows without any agent.
#
# Expected: black_death keeps dead agents with zero observations and rewards until all are done; an
# episode that the environment truncates at step 3 has 3 steps, the last of them truncated and not
# terminated (a learner bootstraps there).
# Seen: step 3 is reported as neither, since the wrapper waits for agents that are both. Then a
# fourth step, in which the environment has no agent left, gives zeros to all, with terminated and
# truncated both true.
# So: time limits are learnt as deaths with value 0, one step late, on a black picture; end the
# episode on `env.unwrapped.agents` being empty, or write the padding oneself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check SuperSuit==3.11.0 pettingzoo==1.27.0 gymnasium==1.4.0
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
import supersuit
from gymnasium.spaces import Box, Discrete
from pettingzoo import ParallelEnv

class World(ParallelEnv):
    metadata = {"name": "world", "render_modes": []}
    possible_agents = ["a", "b"]
    render_mode = None
    steps = 0
    def observation_space(self, agent): return Box(-9, 9, (1,), np.float32)
    def action_space(self, agent): return Discrete(2)
    def reset(self, seed=None, options=None):
        self.agents, self.steps = self.possible_agents[:], 0
        return {a: np.ones(1, np.float32) for a in self.agents}, {a: {} for a in self.agents}
    def step(self, actions):
        self.steps += 1
        agents, over = self.agents, self.steps == 3
        self.agents = [] if over else agents
        same = lambda value: {a: value for a in agents}
        return same(np.full(1, self.steps, np.float32)), same(1.0), same(False), same(over), same({})

def episode(world):
    world.reset(seed=1)
    steps = []
    while world.agents and len(steps) < 9:
        observed, rewards, terminated, truncated, _ = world.step({a: 0 for a in world.possible_agents})
        steps.append((float(observed["a"][0]), rewards["a"], bool(terminated["a"]), bool(truncated["a"])))
    return steps, world.unwrapped.steps

plain, wrapped = episode(World()), episode(supersuit.black_death_v3(World()))
for name, (steps, real) in (("plain", plain), ("black_death", wrapped)):
    print(name, "with", real, "steps of the world (observation, reward, terminated, truncated):", steps)
if plain[0][-1] != (3.0, 1.0, False, True) or len(plain[0]) != 3:
    sys.exit("changed: the plain episode is %s" % plain[0])
if wrapped[0][2:] != [(3.0, 1.0, False, False), (0.0, 0.0, True, True)]:
    sys.exit("changed: the wrapped episode is %s" % wrapped[0])
PY
