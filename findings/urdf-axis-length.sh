#!/usr/bin/env bash
# One URDF in seven libraries: a lift whose axis is (1, 0, 1) goes 1 m, or 1.41 m, and one library
# makes of such a hinge a matrix that is no rotation.
#
# Expected: URDF's axis is a direction that "should be normalized"; a joint value of 1 is 1 m, or 1
# rad, and a longer vector is normalised or refused.
# Seen: pin, urchin and mujoco move the child by 1 m; yourdfpy, kinpy, ikpy and pybullet by 1.41 m.
# Of a hinge the first six make a rotation; ikpy's matrix stretches by a third, so that all that
# hangs on the joint grows.
# So: write unit axes, (0.7071 0 0.7071), and check lengths in a tool before a robot is compared
# between simulators.
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    pin==4.1.0 urchin==0.0.30 yourdfpy==0.0.60 kinpy==0.6.1 ikpy==4.2.1 mujoco==4.0.0 pybullet==3.2.7 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY' 2>"$dir/log" | grep -v "^pybullet build" || { cat "$dir/log" >&2; exit 1; }
import sys
import ikpy.chain
import kinpy
import mujoco
import numpy as np
import pinocchio
import pybullet
import urchin
import yourdfpy

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'

def child(kind):
    text = f"""<robot name="r"><link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link>
    <joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="1 0 1"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/></joint></robot>"""
    path = f"{kind}.urdf"
    open(path, "w").write(text)
    found = {}
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.ones(1))
    found["pin"] = data.oMf[model.getFrameId("b")].homogeneous
    found["urchin"] = urchin.URDF.load(path).link_fk({"j": 1.0}, link="b")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[0] = 1
    mujoco.mj_forward(model, data)
    found["mujoco"] = np.eye(4)
    found["mujoco"][:3] = np.c_[data.xmat[-1].reshape(3, 3), data.xpos[-1]]
    robot = yourdfpy.URDF.load(path, load_meshes=False)
    robot.update_cfg({"j": 1.0})
    found["yourdfpy"] = robot.get_transform("b", "a")
    found["kinpy"] = kinpy.build_chain_from_urdf(text.encode()).forward_kinematics({"j": 1.0})["b"].matrix()
    found["ikpy"] = ikpy.chain.Chain.from_urdf_file(path, base_elements=["a"]).forward_kinematics([0, 1.0])
    pybullet.connect(pybullet.DIRECT)
    body = pybullet.loadURDF(path, useFixedBase=True)
    pybullet.resetJointState(body, 0, 1.0)
    state = pybullet.getLinkState(body, 0, computeForwardKinematics=1)
    found["pybullet"] = np.eye(4)
    found["pybullet"][:3] = np.c_[np.reshape(pybullet.getMatrixFromQuaternion(state[5]), (3, 3)), state[4]]
    pybullet.disconnect()
    return found

lift = {name: round(float(np.linalg.norm(pose[:3, 3])), 2) for name, pose in child("prismatic").items()}
stretch = {name: round(float(np.linalg.norm(pose[:3, :3], 2)), 2) for name, pose in child("revolute").items()}
print("prismatic, metres moved at 1:", lift)
print("revolute, longest image of a unit vector:", stretch)
if lift != {"pin": 1, "urchin": 1, "mujoco": 1, "yourdfpy": 1.41, "kinpy": 1.41, "ikpy": 1.41, "pybullet": 1.41}:
    sys.exit("changed: the lift moves by %s" % lift)
if stretch.pop("ikpy") < 1.1 or set(stretch.values()) != {1.0}:
    sys.exit("changed: the matrices of the hinge stretch otherwise")
PY
