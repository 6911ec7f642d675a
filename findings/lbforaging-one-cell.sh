#!/usr/bin/env bash
# lbforaging 2.0.0: two agents stand in one cell, and two others pass through each other.
#
# Expected: a cell holds one agent: agents are spawned into empty cells, food blocks, and two that
# aim at one cell both stay, so that an agent that stays keeps its cell.
# Seen: only the cells aimed at are compared. If b and c aim at one cell and stay, an agent that
# follows b moves into b's cell: b and its follower are at (3, 3) and observed there. Two neighbours
# that aim at each other's cell change places.
# So: congestion costs less than in simulators of bodies, and paths from this environment may
# collide elsewhere; count steps with `len({p.position for p in env.players}) < n` before comparing.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check lbforaging==2.0.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import gymnasium
import lbforaging  # noqa: F401, registers the environments

NONE, NORTH, SOUTH, WEST, EAST, LOAD = range(6)
env = gymnasium.make("Foraging-8x8-3p-1f-v3").unwrapped
env.reset(seed=1)
env.field[:] = 0
env.field[7, 7] = 1

def step(positions, actions):
    for player, position in zip(env.players, positions):
        player.position = position
    env._gen_valid_moves()
    env.step(actions)
    return [tuple(map(int, player.position)) for player in env.players]

followed = step([(3, 2), (3, 3), (3, 5)], [EAST, EAST, WEST])
swapped = step([(3, 2), (3, 3), (0, 0)], [EAST, WEST, NONE])
print("a follows b, b and c aim at (3, 4):", followed)
print("a and b aim at each other's cell:", swapped)
if followed != [(3, 3), (3, 3), (3, 5)] or swapped != [(3, 3), (3, 2), (0, 0)]:
    sys.exit("changed: positions are %s and %s" % (followed, swapped))
PY
