#!/usr/bin/env bash
# trimesh 5.2.0: a box of 2 m voxelised at 1 m has 27 cells, and no shift makes it 8.
#
# Expected: a box whose faces lie on the lattice, 8 cubic metres, has 2 x 2 x 2 cells of 1 m once
# filled.
# Seen: 27, at every placement tried: cells are *centred* on multiples of the pitch, and each cell
# that the surface touches counts. The volume is 3.4 times too large, at half the pitch still 125 /
# 64.
# So: do not take filled_count * pitch**3 as a volume; for a map, test the cells' centres against
# the inside (`contains`) instead, or shift by half a cell and drop the skin; free space inside a
# mesh loses one whole cell along every wall.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trimesh==5.2.0 scipy==1.17.1 rtree==1.4.1 networkx==3.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import trimesh

counts = {}
for shift in (0.0, 0.25, 0.5):
    for pitch in (1.0, 0.5):
        box = trimesh.creation.box((2, 2, 2))
        box.apply_translation((shift,) * 3)
        counts[shift, pitch] = int(box.voxelized(pitch).fill().filled_count)
        print(f"shift {shift} pitch {pitch}: {counts[shift, pitch]} cells, {counts[shift, pitch] * pitch ** 3} m^3")
box = trimesh.creation.box((2, 2, 2))
centres = np.stack(np.meshgrid(*[np.arange(-1.5, 2)] * 3), -1).reshape(-1, 3)
inside = int(box.contains(centres).sum())
print("centres of cells inside:", inside)
if inside != 8 or counts[0.0, 1.0] != 27 or counts[0.5, 1.0] != 27 or min(counts.values()) < 27:
    sys.exit("changed: counts are %s, centres inside %s" % (counts, inside))
PY
