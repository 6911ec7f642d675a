#!/usr/bin/env bash
# gymnasium 1.4.0: clipped actions have no bounds.
#
# Expected: around an environment with actions from -2 to 2, `ClipAction` still says so: what it
# takes beyond, it clips.
# Seen: the action space becomes -inf to inf. Random actions, the usual baseline, are then normal
# with a deviation of 1 in place of uniform from -2 to 2, and a policy that scales its output to the
# bounds of the space scales to infinity.
# So: sample from `env.unwrapped.action_space`, and clip outside of what learns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import gymnasium
import numpy
from gymnasium import spaces
from gymnasium.wrappers import ClipAction

class Drive(gymnasium.Env):
    action_space = spaces.Box(-2.0, 2.0, (1,))
    observation_space = spaces.Box(-1.0, 1.0, (1,))

def deviation(space):
    space.seed(1)
    return float(numpy.std([space.sample()[0] for _ in range(4000)]))

bare, clipped = Drive(), ClipAction(Drive())
found = [float(clipped.action_space.high[0]), deviation(bare.action_space), deviation(clipped.action_space)]
print("upper bound %s; random actions: deviation %.2f without, %.2f with the wrapper" % tuple(found))
if found[0] != numpy.inf or abs(found[1] - 4 / 12**0.5) > 0.1 or abs(found[2] - 1.0) > 0.1:
    sys.exit("changed: %s" % found)
PY
