#!/usr/bin/env bash
# pyrobosim 5.0.1: walls of a ROS map that are not quite black are free.
#
# Expected: `OccupancyGrid.from_file` reads a map of map_server as its YAML file says: occupied
# where (255 - pixel) / 255 is above `occupied_thresh`, so all pixels up to 89 with 0.65.
# Seen: pixel 0 becomes occupied, 254 free, 205 unknown, and every other pixel keeps its number, of
# which `is_occupied` takes none but 1: walls of 50 and 88, as in maps that were drawn, scaled or
# scanned, are free to its planners. `negate` is not read: with 1 all that is white (a wall then) is
# free. `has_straight_line_connection` gives as "the last point that can be reached" the last wall
# on the line, behind the first. `world_to_grid(grid_to_world(cell))` is the neighbour for 12 of 200
# columns at 0.1 m from -1 m: it gives lower corners, and rounds them down.
# So: write 0, 205 and 254 only (by thresholds, before), and look up centres of cells.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyrobosim==5.0.1
"$dir/venv/bin/python" - "$dir" <<'PY'
import pathlib
import sys
import numpy as np
from PIL import Image
from pyrobosim.navigation.occupancy_grid import OccupancyGrid

folder, pixels = pathlib.Path(sys.argv[1]), [0, 1, 50, 88, 205, 254, 255]
Image.fromarray(np.array([pixels] * 2, np.uint8)).save(folder / "map.pgm")

def occupied(negate):
    (folder / "map.yaml").write_text(
        f"image: {folder}/map.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\n"
        f"negate: {negate}\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    grid = OccupancyGrid.from_file(folder, "map")
    return [pixel for at, pixel in enumerate(pixels) if grid.is_occupied((at, 0))]

found = {negate: occupied(negate) for negate in (0, 1)}
for negate, values in found.items():
    by_rule = [pixel for pixel in pixels if (pixel if negate else 255 - pixel) / 255 > 0.65]
    print(f"negate {negate}: pixels {values} are occupied, by map_server's rule {by_rule}")
grid = OccupancyGrid(np.zeros((200, 5)), 0.1, (-1.0, 0.0))
moved = sum(grid.world_to_grid(grid.grid_to_world((at, 0)))[0] != at for at in range(200))
walls = np.zeros((20, 5))
walls[[5, 12], 2] = 1
line = OccupancyGrid(walls, 1.0).has_straight_line_connection((0, 2), (19, 2))
print("columns that come back as their neighbours:", moved, "| from column 0 with walls in 5 and 12:", line)
if found != {0: [0, 1], 1: [0, 1]} or moved != 12 or line != (False, (12, 2)):
    sys.exit("changed: %s %s %s" % (found, moved, line))
PY
