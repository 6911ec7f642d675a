#!/usr/bin/env bash
# mujoco 4.0.0: of a URDF robot the base hangs in the air without a mass, and the frames of fixed
# joints are gone.
#
# Expected: a robot that is loaded from URDF falls when nothing holds it, weighs what its links
# weigh, and has a body for each link, so that a laser can be placed at the link `lidar`.
# Seen: the first link becomes the world itself: its 10 kg are gone, it does not fall, and the links
# that are fixed to it, with their masses, are gone as well; a link that is fixed to a moving one is
# merged with that. Four links and 14 kg leave one body of 2 kg. Shapes for display only are left
# out too, so a wall without <collision> is not there for rays.
# So: add `<mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco>` to the file and a
# floating joint at its root; compare the sum of the masses with the file's.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mujoco==4.0.0
"$dir/venv/bin/python" - <<'PY'
import sys
import mujoco

def link(name, mass, shape=""):
    return f"""<link name="{name}"><inertial><mass value="{mass}"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{shape}</link>"""
def joint(name, kind, parent, child):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="0 1 0"/></joint>'
box = '<geometry><box size="1 1 1"/></geometry>'
parts = link("base", 10, f"<collision>{box}</collision><visual>{box}</visual>") + link("lidar", 2) + link("arm", 1) + link("tip", 1)
parts += joint("mount", "fixed", "base", "lidar") + joint("shoulder", "continuous", "base", "arm") + joint("end", "fixed", "arm", "tip")
found = {}
for option in ("", '<mujoco><compiler fusestatic="false" discardvisual="false"/></mujoco>'):
    model = mujoco.MjModel.from_xml_string(f'<robot name="r">{option}{parts}</robot>')
    names = [model.body(index).name for index in range(1, model.nbody)]
    found[option] = names, float(model.body_mass.sum()), model.ngeom, model.nq
    print(f"{'with' if option else 'without'} the options: bodies {names}, {found[option][1]} kg, {model.ngeom} shapes, {model.nq} coordinate")
if found[""] != (["arm"], 2.0, 1, 1):
    sys.exit("changed: it is %s" % (found[""],))
PY
