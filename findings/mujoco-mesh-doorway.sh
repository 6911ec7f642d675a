#!/usr/bin/env bash
# mujoco 4.0.0: a wall with a doorway, as one mesh, lets rays through and stops the robot; its
# position in the simulation is not the one in the file.
#
# Expected: range finder and contacts see one geometry, and `geom_xpos` of a wall at (5, 0, 0)
# without a rotation is that.
# Seen: rays are cast at the triangles and go through the doorway; contacts are with the convex
# hull, so a robot in the middle of the doorway is 0.4 m deep in the wall. The mesh is moved to its
# centre of mass and turned to its axes of inertia: `geom_xpos` is 1.3 m higher and `geom_xmat` is
# turned by 90 degrees.
# So: cut buildings into convex parts (each its own mesh) before loading them; compare poses of
# bodies, not of geoms. A map made of rays shows doors that cannot be passed.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0 trimesh==5.2.0 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY'
import sys
import mujoco
import numpy as np
import trimesh

boxes = [[[-0.1, -3, 0], [0.1, -0.5, 2.5]], [[-0.1, 0.5, 0], [0.1, 3, 2.5]], [[-0.1, -0.5, 2], [0.1, 0.5, 2.5]]]
trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes]).export("wall.obj")
model = mujoco.MjModel.from_xml_string("""<mujoco><asset><mesh name="wall" file="wall.obj"/></asset><worldbody>
<geom type="mesh" mesh="wall" pos="5 0 0"/>
<body pos="5 0 1"><joint type="slide" axis="1 0 0"/><geom type="sphere" size="0.3" mass="1"/></body></worldbody></mujoco>""")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
hit, normal = np.zeros(1, np.int32), np.zeros(3)
def ray(y):
    return round(mujoco.mj_ray(model, data, np.array([1.0, y, 1.0]), np.array([1.0, 0, 0]), None, 1, 1, hit, normal), 2)
data.qpos[0] = 20
mujoco.mj_forward(model, data)
door, wall = ray(0), ray(2)
data.qpos[0] = 0
mujoco.mj_forward(model, data)
depths = [round(contact.dist, 2) for contact in data.contact[: data.ncon]]
position, turned = data.geom_xpos[0].round(2) + 0.0, not np.allclose(data.geom_xmat[0].reshape(3, 3), np.eye(3), atol=0.01)
print("ray at the doorway:", "nothing" if door == -1 else door, "| at the wall:", wall)
print("contacts of a robot in the doorway:", depths, "| the wall is at", position.tolist(), "turned:", turned)
if door != -1 or wall != 3.9 or not depths or min(depths) > -0.3:
    sys.exit("changed: rays %s, contacts %s" % ((door, wall), depths))
if position.tolist() != [5, 0, 1.3] or not turned:
    sys.exit("changed: the wall is at %s" % position)
PY
