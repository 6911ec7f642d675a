#!/usr/bin/env bash
# pyvisgraph 0.2.1: the shortest path leads through a wall along the edge that two obstacles share.
#
# Expected: obstacles are simple polygons, and the path goes round them. A wall that is drawn as two
# rectangles, one above the other, is as closed as one rectangle.
# Seen: round the single rectangle the path is 8.3 long. Through the same wall in two pieces it is 3.2
# long: from one end of the shared edge to the other, inside of the wall. Two squares that touch at a corner
# let it pass there, straight from one side to the other.
# So: unite obstacles first (shapely's unary_union), and grow them by the radius of the robot.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyvisgraph==0.2.1 tqdm==4.70.1
"$dir/venv/bin/python" - <<'PY'
import math
import sys
from pyvisgraph import Point, VisGraph

def box(low_x, low_y, high_x, high_y):
    return [Point(low_x, low_y), Point(high_x, low_y), Point(high_x, high_y), Point(low_x, high_y)]

def shortest(obstacles, start, end):
    graph = VisGraph()
    graph.build(obstacles, status=False)
    path = [(point.x, point.y) for point in graph.shortest_path(Point(*start), Point(*end))]
    return path, sum(map(math.dist, path, path[1:]))

whole, round_it = shortest([box(1, -1, 2, 7)], (0, 2.5), (3, 2.5))
pieces, through = shortest([box(1, -1, 2, 3), box(1, 3, 2, 7)], (0, 2.5), (3, 2.5))
corner, _ = shortest([box(0, 0, 1, 1), box(1, 1, 2, 2)], (0.2, 1.8), (1.8, 0.2))
print(f"round one rectangle: {whole}, {round_it:.1f}")
print(f"the same wall in two pieces: {pieces}, {through:.1f}")
print(f"between squares that touch at a corner: {corner}")
if len(whole) != 4 or whole[1:3] not in ([(1, -1), (2, -1)], [(1, 7), (2, 7)]):
    sys.exit(f"changed: round one rectangle the path is {whole}")
if pieces[1:3] != [(1, 3), (2, 3)] or len(corner) != 2:
    sys.exit(f"changed: the paths are {pieces} and {corner}")
PY
