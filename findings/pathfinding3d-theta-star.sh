#!/usr/bin/env bash
# pathfinding3d 0.7.2: paths of Theta* go straight through blocked cells.
#
# Expected: Theta* (Nash and others 2007) joins two nodes only if the straight line between their centres
# is free, so that its waypoints can be flown.
# Seen: in random grids of 5^3 cells, a third of them blocked, a quarter of the paths have a leg through
# the inside of a blocked cell, a tenth of a cell from its edges or more. Paths of A* in the same grids
# have none.
# So: check legs of Theta* for collision, or take A* and straighten its path with a check of your own.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pathfinding3d==0.7.2 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import logging
import sys
import numpy as np
from pathfinding3d.core.diagonal_movement import DiagonalMovement
from pathfinding3d.core.grid import Grid
from pathfinding3d.finder.a_star import AStarFinder
from pathfinding3d.finder.theta_star import ThetaStarFinder

logging.disable(logging.CRITICAL)

def leaves_free_space(free, path):
    points = np.array([(node.x, node.y, node.z) for node in path], float)
    for start, end in zip(points, points[1:]):
        for share in np.linspace(0, 1, 401):
            at = start + share * (end - start)
            cell = np.rint(at).astype(int)
            if np.abs(at - cell).max() < 0.4 and not free[tuple(cell)]:
                return True
    return False

rng = np.random.default_rng(3)
found, through = {}, {}
for _ in range(80):
    free = (rng.random((5, 5, 5)) > 0.35).astype(int)
    free[0, 0, 0] = free[4, 4, 4] = 1
    for finder in (AStarFinder, ThetaStarFinder):
        grid = Grid(matrix=free.tolist())
        search = finder(diagonal_movement=DiagonalMovement.always)
        path, _ = search.find_path(grid.node(0, 0, 0), grid.node(4, 4, 4), grid)
        name = finder.__name__
        found[name] = found.get(name, 0) + bool(path)
        through[name] = through.get(name, 0) + (bool(path) and leaves_free_space(free, path))
for name in found:
    print(f"{name}: {found[name]} paths, {through[name]} of them through blocked cells")
if through["AStarFinder"] or through["ThetaStarFinder"] < found["ThetaStarFinder"] / 10:
    sys.exit(f"changed: through blocked cells {through} of {found}")
PY
