#!/usr/bin/env bash
# pin 4.1.0 beside yourdfpy, urchin, kinpy, mujoco and pybullet: the joints of one URDF have the
# order of the file, or of the alphabet.
#
# Expected: a vector of joint values is in the order of the file's joints, as in the five others, so
# that a log of one library can be played in another.
# Seen: pin sorts the children of a link by the names of their joints: `wheel_right`, `arm`,
# `arm_tip` become `arm`, `arm_tip`, `wheel_right`. All are hinges, so lengths agree and nothing
# fails: the arm turns by the wheel's angle. A rename of a joint changes the order.
# So: index by name, `model.joints[model.getJointId(name)].idx_q`, and store names beside values as
# sensor_msgs/JointState does.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    pin==4.1.0 urchin==0.0.30 yourdfpy==0.0.60 kinpy==0.6.1 mujoco==4.0.0 pybullet==3.2.7 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
import sys
import kinpy
import mujoco
import pinocchio
import pybullet
import urchin
import yourdfpy

def link(name):
    return f"""<link name="{name}"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
def joint(name, parent, child):
    return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
text = '<robot name="r">' + "".join(map(link, ("base", "wheel", "upper", "lower"))) + (
    joint("wheel_right", "base", "wheel") + joint("arm", "base", "upper") + joint("arm_tip", "upper", "lower")) + "</robot>"
with open("r.urdf", "w") as file:
    file.write(text)
model = mujoco.MjModel.from_xml_string(text)
pybullet.connect(pybullet.DIRECT)
body = pybullet.loadURDF("r.urdf")
found = {
    "pin": list(pinocchio.buildModelFromXML(text).names)[1:],
    "yourdfpy": list(yourdfpy.URDF.load("r.urdf", load_meshes=False).actuated_joint_names),
    "urchin": [joint.name for joint in urchin.URDF.load("r.urdf").actuated_joints],
    "kinpy": kinpy.build_chain_from_urdf(text.encode()).get_joint_parameter_names(),
    "mujoco": [model.joint(index).name for index in range(model.njnt)],
    "pybullet": [pybullet.getJointInfo(body, index)[1].decode() for index in range(pybullet.getNumJoints(body))],
}
for name, joints in found.items():
    print(f"{name}: {joints}")
alphabet = found.pop("pin")
if alphabet != ["arm", "arm_tip", "wheel_right"] or any(order != ["wheel_right", "arm", "arm_tip"] for order in found.values()):
    sys.exit("changed: the orders are %s and %s" % (alphabet, found))
PY
