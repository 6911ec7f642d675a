#!/usr/bin/env bash
# gtsam 4.3.0: a line `FIX 0` or a comment before the edges, and the 2-D graph that is read has no
# edges.
#
# Expected: lines that a reader of g2o files does not know are skipped; `FIX` (the anchor) is
# written by g2o itself, and comments by people.
# Seen: `readG2o(path, False)` returns the three poses and a graph of 0 factors, without an error;
# with the line at the end of the file both edges are there; so they are in 3-D files with it
# anywhere.
# So: compare the size of the graph with the count of lines `EDGE_`; strip FIX and comments.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check gtsam==4.3.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import gtsam

vertices = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 2 0 0\n"
edges = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n"
vertices3 = "".join(f"VERTEX_SE3:QUAT {i} {i} 0 0 0 0 0 1\n" for i in range(2))
edges3 = "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 " + "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n"

def sizes(text, is_3d=False):
    path = sys.argv[1] + "/a.g2o"
    open(path, "w").write(text)
    graph, values = gtsam.readG2o(path, is_3d)
    return values.size(), graph.size()

found = {
    "plain": sizes(vertices + edges), "FIX before the edges": sizes(vertices + "FIX 0\n" + edges),
    "comment before the edges": sizes("# made by hand\n" + vertices + edges),
    "FIX at the end": sizes(vertices + edges + "FIX 0\n"), "3-D, FIX before": sizes(vertices3 + "FIX 0\n" + edges3, True),
}
for name, (poses, factors) in found.items():
    print(f"{name}: {poses} poses, {factors} edges")
if list(found.values()) != [(3, 2), (3, 0), (3, 0), (3, 2), (2, 1)]:
    sys.exit("changed: it is %s" % found)
PY
