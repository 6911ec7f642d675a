#!/usr/bin/env bash
# Two robots at one place are not connected: networkx 3.6.1 and SciPy 1.17.1 (csgraph).
#
# Expected: of a matrix of distances between robots, 0 beside the diagonal is a distance of 0: the
# shortest path between the two has length 0, the minimum spanning tree has the length 5.
# Seen: `from_numpy_array` makes no edge of a 0, and csgraph takes a 0 of a dense array as no edge.
# With robots 0 and 1 at one place and robot 2 5 m away, the path from 0 to 1 leads over 2 and is 10
# m long, the tree is 10 m long: both robots at the place are joined to the far one. A communication
# graph without robot 2 falls apart. A sparse matrix that stores the 0 is right in csgraph's paths.
# So: build the graph from a list of edges (`add_weighted_edges_from`, `coo_array`), or add a tiny
# length everywhere; robots that start at one place, or meet, are in nearly each run.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check networkx==3.6.1 scipy==1.17.1
"$dir/venv/bin/python" - <<'PY'
import sys
import networkx
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree

places = np.array([[0, 0], [0, 0], [3, 4.0]])
metres = np.hypot(*(places[:, None] - places).T)
pairs = [(a, b) for a in range(3) for b in range(3) if a != b]
stored = coo_array(([metres[pair] for pair in pairs], np.transpose(pairs)), shape=(3, 3)).tocsr()
dense, listed = networkx.from_numpy_array(metres), networkx.Graph()
listed.add_weighted_edges_from((a, b, metres[a, b]) for a, b in pairs)

def of_graph(graph):
    tree = networkx.minimum_spanning_tree(graph)
    return [networkx.dijkstra_path_length(graph, 0, 1), tree.size(weight="weight")]

def of_matrix(matrix):
    return [float(dijkstra(matrix)[0, 1]), float(minimum_spanning_tree(matrix).sum())]

found = {"networkx, array": of_graph(dense), "networkx, edges": of_graph(listed),
         "SciPy, array": of_matrix(metres), "SciPy, stored zeros": of_matrix(stored)}
for name, (path, tree) in found.items():
    print(f"{name}: path between the two {path} m, spanning tree {tree} m")
pair = metres[:2, :2]
parts = [networkx.number_connected_components(networkx.from_numpy_array(pair)), int(connected_components(pair)[0])]
print("the two alone: parts", parts)
if found["networkx, array"] != [10, 10] or found["SciPy, array"] != [10, 10] or parts != [2, 2]:
    sys.exit("changed: arrays give %s, parts %s" % (found, parts))
if found["networkx, edges"] != [0, 5] or found["SciPy, stored zeros"][0] != 0:
    sys.exit("changed: edges give %s" % found)
PY
