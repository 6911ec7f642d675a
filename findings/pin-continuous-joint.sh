#!/usr/bin/env bash
# pin 4.1.0: a continuous joint has two values; given an angle and a zero, the wheel shrinks to half
# its size.
#
# Expected: a joint that turns has one value, its angle, or two that are checked.
# Seen: of type "continuous" the configuration is (cos, sin), of "revolute" it is the angle. A
# vector [0.5, 0] is taken as it is: the "rotation" of the wheel is diag(0.5, 0.5, 1), and all that
# hangs on it is scaled. Nothing is raised, and the order of the other joints in the vector is
# shifted by one. A coupled joint (`mimic`) is a free one unless `mimic=True` is given.
# So: start from `pin.neutral(model)` and move by `pin.integrate`; check `model.nq == model.nv`
# before a vector of angles is passed.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pin==4.1.0 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pinocchio

LINK = '<link name="%s"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
JOINT = """<joint name="%s" type="%s"><parent link="base"/><child link="%s"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/>%s</joint>"""
wheel = pinocchio.buildModelFromXML('<robot name="r">' + LINK % "base" + LINK % "wheel" + JOINT % ("j", "continuous", "wheel", "") + "</robot>")
data = wheel.createData()
pinocchio.framesForwardKinematics(wheel, data, np.array([0.5, 0.0]))
rotation = data.oMf[wheel.getFrameId("wheel")].rotation
coupled = '<robot name="r">' + LINK % "base" + LINK % "a" + LINK % "b" + JOINT % ("a", "revolute", "a", "") + (
    JOINT % ("b", "revolute", "b", '<mimic joint="a" multiplier="2"/>')) + "</robot>"
free, followed = pinocchio.buildModelFromXML(coupled).nq, pinocchio.buildModelFromXML(coupled, mimic=True).nq
print("values of one wheel:", wheel.nq, "| its rotation at [0.5, 0]:", rotation.round(3).tolist())
print("values of two coupled joints:", free, "| with mimic=True:", followed)
if wheel.nq != 2 or not np.allclose(rotation, np.diag([0.5, 0.5, 1])) or (free, followed) != (2, 1):
    sys.exit("changed: %s values, rotation %s, coupled %s" % (wheel.nq, rotation, (free, followed)))
PY
