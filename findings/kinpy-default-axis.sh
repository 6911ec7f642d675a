#!/usr/bin/env bash
# kinpy 0.6.1: a joint without <axis> turns about z, where URDF says x.
#
# Expected: URDF's axis is optional and is (1, 0, 0) if it is left out; so do urdfdom, pin, mujoco,
# yourdfpy and urchin.
# Seen: kinpy turns the joint about (0, 0, 1), without a word: the arm that should nod shakes its
# head, and the forward and inverse kinematics agree with each other, so no residual tells.
# So: write the axis of each joint; exporters that leave out what is the default break here.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check kinpy==0.6.1 yourdfpy==0.0.60 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import kinpy
import numpy as np
import yourdfpy

text = """<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">
<parent link="a"/><child link="b"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""
open("r.urdf", "w").write(text)
robot = yourdfpy.URDF.load("r.urdf", load_meshes=False)
robot.update_cfg({"j": np.pi / 2})
up = np.array([0, 0, 1])
found = {
    "kinpy": kinpy.build_chain_from_urdf(text.encode()).forward_kinematics({"j": np.pi / 2})["b"].matrix()[:3, :3] @ up,
    "yourdfpy": robot.get_transform("b", "a")[:3, :3] @ up,
}
found = {name: (np.round(vector, 3) + 0.0).tolist() for name, vector in found.items()}
print("where the child's z axis points after 90 degrees:", found)
if found != {"kinpy": [0, 0, 1], "yourdfpy": [0, -1, 0]}:
    sys.exit("changed: it points to %s" % found)
PY
