#!/usr/bin/env bash
# pathfinding 1.0.23: the bidirectional A* finds paths that cost more than A*'s, on nearly every map
# with costs.
#
# Expected: BiAStarFinder is A* from both ends; the path may differ, its cost may not.
# Seen: on 6 x 6 cells of costs 1, 2, 5 and 9 it is dearer than Dijkstra's in most of 200 maps: it
# stops where the two searches first touch. It goes straight through a cell of cost 9, 11 in all,
# where the way round costs 7. On maps of free and blocked cells its paths are shortest, so the
# usual test passes.
# So: use AStarFinder for weighted maps (equal to Dijkstra in all 200); test planners on costs, not
# only on walls.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pathfinding==1.0.23
"$dir/venv/bin/python" - <<'PY'
import random
import sys
from pathfinding.core.diagonal_movement import DiagonalMovement
from pathfinding.core.grid import Grid
from pathfinding.finder.a_star import AStarFinder
from pathfinding.finder.bi_a_star import BiAStarFinder
from pathfinding.finder.dijkstra import DijkstraFinder

def costs(matrix, goal):
    for finder in (DijkstraFinder, AStarFinder, BiAStarFinder):
        grid = Grid(matrix=matrix)
        path, _ = finder(diagonal_movement=DiagonalMovement.never).find_path(grid.node(0, 0), grid.node(*goal), grid)
        yield sum(matrix[node.y][node.x] for node in path[1:])

dice = random.Random(1)
small = list(costs([[1, 9, 1, 1], [1, 9, 1, 1], [1, 1, 1, 1]], (3, 0)))
weighted = [list(costs([[dice.choice([1, 1, 2, 5, 9]) for _ in range(6)] for _ in range(6)], (5, 5)))
            for _ in range(200)]
plain = []
for _ in range(200):
    matrix = [[int(dice.random() > 0.3) for _ in range(8)] for _ in range(8)]
    matrix[0][0] = matrix[7][7] = 1
    plain.append(list(costs(matrix, (7, 7))))
dearer = lambda results, which: sum(r[which] > r[0] for r in results)
print("round a wall of cost 9: Dijkstra, A*, bidirectional A* cost", small)
print("of 200 maps with costs dearer than Dijkstra: A*", dearer(weighted, 1), "bidirectional", dearer(weighted, 2))
print("of 200 maps of walls: A*", dearer(plain, 1), "bidirectional", dearer(plain, 2))
if small[:2] != [7, 7] or small[2] <= 7 or dearer(weighted, 1) or dearer(weighted, 2) < 100:
    sys.exit("changed: costs are %s, dearer %s" % (small, dearer(weighted, 2)))
if dearer(plain, 1) or dearer(plain, 2):
    sys.exit("changed: among walls %s are longer" % dearer(plain, 2))
PY
