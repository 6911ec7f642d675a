#!/usr/bin/env bash
# dijkstra3d 1.15.2: with bidirectional=True, or compass=True and 18 neighbours, some paths cost more
# than the cheapest.
#
# Expected: its README offers both as faster or smaller ways to the path of least cost; compass is A*
# with a bound from the Chebyshev distance. The path may differ, its cost may not.
# Seen: on 6^3 voxels of costs 1 to 19, from corner to corner, the bidirectional search returns a dearer
# path in some of each hundred volumes, with 6, 18 and 26 neighbours: it ends where the searches first
# meet. compass is exact with 6 and 26 neighbours, and dearer in some volumes with 18.
# So: plan with the defaults, whose costs are those of distance_field in every volume.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check dijkstra3d==1.15.2 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import dijkstra3d
import numpy as np

start, goal = (0, 0, 0), (5, 5, 5)

def cost(field, **how):
    path = dijkstra3d.dijkstra(field, start, goal, **how)
    return field[tuple(path[1:].T)].sum()

rng = np.random.default_rng(2)
fields = [rng.integers(1, 20, (6, 6, 6)).astype(np.float32) for _ in range(300)]
dearer = {}
for connectivity in (6, 18, 26):
    best = [dijkstra3d.distance_field(field, start, connectivity=connectivity)[goal] for field in fields]
    for name, how in (("default", {}), ("bidirectional", {"bidirectional": True}), ("compass", {"compass": True})):
        costs = [cost(field, connectivity=connectivity, **how) for field in fields]
        dearer[name, connectivity] = sum(c > b for c, b in zip(costs, best))
        print(f"{connectivity} neighbours, {name}: {dearer[name, connectivity]} of {len(fields)} paths are dearer")
exact = [dearer["default", n] for n in (6, 18, 26)] + [dearer["compass", 6], dearer["compass", 26]]
wrong = [dearer["bidirectional", n] for n in (6, 18, 26)] + [dearer["compass", 18]]
if any(exact) or not all(wrong):
    sys.exit(f"changed: {dearer}")
PY
