#!/usr/bin/env bash
# mujoco 4.0.0: a ray finds no floor beyond the floor's drawn size, where the robot stands on it.
#
# Expected: a plane is infinite for collisions, and its `size` is for drawing (XML reference,
# geom/size); a range sensor (`mj_ray`, `rangefinder`) above it measures the height.
# Seen: ten metres from the middle of a plane of half-size 2 a ball comes to rest on it, and a ray
# straight down from there answers -1, "nothing there". Within the drawn size the ray measures
# well.
# So: a LiDAR in such a world sees a floor of 4 x 4 m in the void. Give a plane `size="0 0 1"`
# (drawn without end, and hit everywhere) or a size that covers the world.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0
"$dir/venv/bin/python" - <<'PY'
import sys
import mujoco
import numpy as np

def run(size):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody><geom type="plane" size="{size}"/>
    <body name="ball" pos="10 0 0.5"><freejoint/><geom type="sphere" size="0.1" mass="1"/></body>
    </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=2000)
    hit, down = np.zeros(1, np.int32), np.array([0.0, 0.0, -1.0])
    ranges = [mujoco.mj_ray(model, data, np.array([x, 1.0, 1.0]), down, None, 1, -1, hit, None) for x in (0, 10)]
    return round(float(data.body("ball").xpos[2]), 2), [round(r, 3) for r in ranges]

small, endless = run("2 2 0.1"), run("0 0 1")
print("half-size 2: ball rests at", small[0], "| ranges at 0 m and 10 m:", small[1])
print("size 0:      ball rests at", endless[0], "| ranges at 0 m and 10 m:", endless[1])
if small != (0.1, [1.0, -1.0]):
    sys.exit("changed: with half-size 2 it is %s" % (small,))
if endless != (0.1, [1.0, 1.0]):
    sys.exit("changed: with size 0 it is %s" % (endless,))
PY
