#!/usr/bin/env bash
# mujoco 4.0.0: what is drawn with alpha 0 stops a robot but no ray.
#
# Expected: `rgba` is for drawing (XML reference, geom/rgba); the usual way to hide the collision
# shapes under a visual mesh is alpha 0, and a LiDAR is stopped by what stops a robot.
# Seen: a wall of alpha 0, or of a material of alpha 0, gives -1 to `mj_ray` and the range finder,
# while a ball thrown at it bounces back. At alpha 0.001 it is seen. A wall without contacts
# (contype and conaffinity 0) is seen too.
# So: hide collision shapes by `group`, which rays take only if asked to (`geomgroup`), not by
# colour; test that a ray and a body stop at the same place.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0
"$dir/venv/bin/python" - <<'PY'
import sys
import mujoco
import numpy as np

def wall(look):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><option gravity="0 0 0"/>
    <asset><material name="clear" rgba="1 1 1 0"/></asset><worldbody>
    <geom type="box" pos="2 0 0" size="0.1 5 5" {look}/>
    <body name="ball" pos="0 1 0"><freejoint/><geom type="sphere" size="0.1" mass="1"/></body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    seen = mujoco.mj_ray(model, data, np.zeros(3), np.array([1.0, 0, 0]), None, 1, -1, hit, None)
    data.qvel[0] = 1.0
    mujoco.mj_step(model, data, nstep=3000)
    return round(seen, 3), bool(data.body("ball").xpos[0] < 2)

looks = {"plain": "", "alpha 0.001": 'rgba="1 1 1 0.001"', "alpha 0": 'rgba="1 1 1 0"',
         "material of alpha 0": 'material="clear"', "no contacts": 'contype="0" conaffinity="0"'}
found = {name: wall(look) for name, look in looks.items()}
for name, (seen, stopped) in found.items():
    print(f"{name}: range {seen}, the ball is {'stopped' if stopped else 'let through'}")
if found != {"plain": (1.9, True), "alpha 0.001": (1.9, True), "alpha 0": (-1.0, True),
             "material of alpha 0": (-1.0, True), "no contacts": (1.9, False)}:
    sys.exit("changed: it is %s" % found)
PY
