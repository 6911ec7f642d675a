#!/usr/bin/env bash
# pybullet 3.2.7: the inertia in a URDF file is not used, unless a flag says so.
#
# Expected: `<inertia ixx="0.5" iyy="0.6" izz="0.7"/>` is the inertia of the link, as in every other
# simulator that reads URDF.
# Seen: `loadURDF` computes it from the collision shape, here 0.333 on each axis of a box of 2 kg;
# only with the flag URDF_USE_INERTIA_FROM_FILE the file counts.
# So: give the flag whenever motion is compared between simulators, above all for links whose
# collision shape is a simplified one, as rotors or a battery in a hull are.
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY' 2>"$dir/log" | grep -v "^pybullet build" || { cat "$dir/log" >&2; exit 1; }
import sys
import pybullet

with open("robot.urdf", "w") as file:
    file.write("""<robot name="r"><link name="l"><inertial><mass value="2"/>
<inertia ixx="0.5" iyy="0.6" izz="0.7" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="1 1 1"/></geometry></collision></link></robot>""")
pybullet.connect(pybullet.DIRECT)
def inertia(flags):
    return [round(value, 3) for value in pybullet.getDynamicsInfo(pybullet.loadURDF("robot.urdf", flags=flags), -1)[2]]
plain, flagged = inertia(0), inertia(pybullet.URDF_USE_INERTIA_FROM_FILE)
print("inertia by default:", plain, "| with the flag:", flagged)
if plain != [0.333] * 3 or flagged != [0.5, 0.6, 0.7]:
    sys.exit("changed: it is %s and %s" % (plain, flagged))
PY
