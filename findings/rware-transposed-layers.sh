#!/usr/bin/env bash
# rware 2.0.0: of an image observation two layers are transposed, so an agent's direction and load
# are drawn beside the agent.
#
# Expected: all layers of one image show the same cells: where AGENTS is 1, AGENT_DIRECTION is that
# agent's direction and AGENT_LOAD tells whether it carries a shelf.
# Seen: these two layers are indexed by (x, y), the others by (row, column). An agent at x = 4, y =
# 3 has its direction at the cell of an agent at x = 3, y = 4; on a map that is wider than high an
# agent further right than the map is high ends with an IndexError.
# So: leave the two layers out of `image_observation_layers`, or take them from the agents yourself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rware==2.0.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings

warnings.simplefilter("ignore")
import numpy as np
from rware.warehouse import Direction, ImageLayer, ObservationType, RewardType, Warehouse

LAYERS = [ImageLayer.AGENTS, ImageLayer.AGENT_DIRECTION, ImageLayer.AGENT_LOAD]
env = Warehouse(3, 8, 1, 1, 0, 2, 2, None, 100, RewardType.INDIVIDUAL, layout="..........\n.xx....xx.\n.xx....xx.\n..........\n....gg....",
                observation_type=ObservationType.IMAGE, image_observation_layers=LAYERS, image_observation_directional=False)
env.reset(seed=3)
agent = env.agents[0]

def cells(x, y):
    agent.x, agent.y, agent.dir, agent.carrying_shelf = x, y, Direction.LEFT, env.shelfs[0]
    env._recalc_grid()
    try:
        image = env._make_obs(agent)
    except IndexError as error:
        return type(error).__name__
    # the window's upper left cell is (y - 2, x - 2)
    return {layer.name: [(int(c) + x - 2, int(r) + y - 2) for r, c in np.argwhere(picture)] for layer, picture in zip(LAYERS, image)}

near, far = cells(4, 3), cells(8, 3)
print("map of", env.grid_size, "rows and columns; agent at x = 4, y = 3:", near)
print("agent at x = 8, y = 3:", far)
if near != {"AGENTS": [(4, 3)], "AGENT_DIRECTION": [(3, 4)], "AGENT_LOAD": [(3, 4)]} or far != "IndexError":
    sys.exit("changed: cells are %s and %s" % (near, far))
PY
