#!/usr/bin/env bash
# minigrid 3.2.0: an agent that does not see through walls sees all of a room behind a wall with one
# opening in its corner, and out of a closet.
#
# Expected: with `see_through_walls=False`, the default of MiniGridEnv, the view is occluded by what
# lies between: behind a wall without an opening in the line of sight cells are `unseen` (0).
# Seen: `process_vis` has no lines of sight. Light walks ahead, sideways and to both diagonals
# ahead, from cell to free cell: a 7x7 view has 49 visible cells behind a wall whose one opening is
# at its end, and behind two such walls with openings at opposite ends. It also goes between two
# walls that touch at a corner: with walls ahead, on the left and on the right 45 of 49 cells are
# seen. Only a wall of full width holds it.
# So: rates of exploration from MiniGrid's views are too good beside those of a LiDAR; for occlusion
# compute a mask by rays and pass it to `grid.encode(vis_mask)`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check minigrid==3.2.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
from minigrid.core.grid import Grid
from minigrid.core.world_object import Wall

AGENT, SIZE = (3, 6), 7  # the view's own frame: the agent at the middle of the last row, looking up

def seen(cells):
    grid = Grid(SIZE, SIZE)
    for x, y in cells:
        grid.set(x, y, Wall())
    return int(grid.process_vis(AGENT).sum())

row = lambda y, opening: [(x, y) for x in range(SIZE) if x != opening]
found = {"one wall, opening at the left end": seen(row(5, 0)), "two walls, openings at opposite ends": seen(row(5, 0) + row(3, 6)),
         "walls ahead, left and right": seen([(2, 6), (3, 5), (4, 6)]), "a closed wall": seen(row(5, None))}
for name, count in found.items():
    print(f"{name}: {count} of 49 cells are seen")
if list(found.values()) != [49, 49, 45, 14]:
    sys.exit("changed: %s" % found)
PY
