#!/usr/bin/env bash
# pybullet 3.2.7: a plateau at 10 m with a summit of 12 m lies between -1 and 1 m.
#
# Expected: heights of `GEOM_HEIGHTFIELD` are heights above the body's origin, so a model of the
# ground placed at z = 0 has its ground where the data say.
# Seen: the field is moved so that the middle of its lowest and highest value is at the origin: 10
# and 12 become -1 and 1. Adding one summit of 20 m lowers the plateau from -1 to -5. The plan is
# centred too: 4 x 3 samples reach from -1.5 to 1.5 and from -1 to 1.
# So: place the body at z = (lowest + highest) / 2, anew for every map; check with one ray down.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import pybullet as p

p.connect(p.DIRECT)

def field(summit):
    heights = [10.0] * 12
    heights[0] = summit
    shape = p.createCollisionShape(p.GEOM_HEIGHTFIELD, meshScale=[1, 1, 1], heightfieldData=heights,
                                   numHeightfieldRows=4, numHeightfieldColumns=3)
    body = p.createMultiBody(0, shape, basePosition=[0, 0, 0])
    low, high = p.getAABB(body)
    ground = p.rayTest([1.2, 0.5, 50], [1.2, 0.5, -50])[0][3][2]
    p.removeBody(body)
    return [round(v, 2) for v in low], [round(v, 2) for v in high], round(ground, 2)

found = {summit: field(summit) for summit in (12.0, 20.0)}
for summit, (low, high, ground) in found.items():
    print(f"plateau 10 m, summit {summit} m: bounds {low} to {high}, a ray finds the plateau at {ground}")
if found[12.0] != ([-1.5, -1.0, -1.0], [1.5, 1.0, 1.0], -1.0) or found[20.0][2] != -5.0:
    sys.exit("changed: it is %s" % found)
PY
