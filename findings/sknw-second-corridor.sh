#!/usr/bin/env bash
# sknw 0.15: of two corridors between the same junctions one is lost, and which one depends on the
# orientation of the map.
#
# Expected: a graph of a skeleton has an edge for every branch; a graph that can hold one edge
# between two nodes keeps the shortest for `shortest_path`.
# Seen: `build_sknw(skeleton)` makes an `nx.Graph` (`multi=False`), in which the branch that is
# traced last overwrites the others. A route of 22.8 cells is 34.8 cells long, and 22.8 again on the
# same map upside down; with `multi=True` it is 22.8 in both.
# So: pass `multi=True` on maps with loops, and take the least weight of parallel edges.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check sknw==0.15 numpy==2.4.6 networkx==3.6.1
"$dir/venv/bin/python" - <<'PY'
import sys
import networkx as nx
import numpy as np
import sknw

def skeleton():
    cells, row = np.zeros((24, 21), np.uint16), 11
    cells[row, 1:6] = cells[row, 15:20] = 1
    for height, side in ((3, -1), (9, 1)):  # two corridors from (11, 5) to (11, 15)
        cells[row + side * height, 6:15] = 1
        for step in range(1, height):
            cells[row + side * step, [5, 15]] = 1
    return cells

def route(cells, multi):
    graph = sknw.build_sknw(cells, multi=multi)
    ends = [node for node, degree in graph.degree() if degree == 1]
    return graph.number_of_edges(), round(float(nx.shortest_path_length(graph, *ends, weight="weight")), 1)

found = {(name, multi): route(cells, multi) for name, cells in (("map", skeleton()), ("upside down", skeleton()[::-1].copy()))
         for multi in (False, True)}
for (name, multi), (edges, length) in found.items():
    print(f"{name}, multi={multi}: {edges} edges, route of {length}")
if list(found.values()) != [(3, 34.8), (4, 22.8), (3, 22.8), (4, 22.8)]:
    sys.exit("changed: %s" % found)
PY
