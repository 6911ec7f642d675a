#!/usr/bin/env bash
# pybullet 3.2.7: a world file that was written anew is loaded as it was the first time.
#
# Expected: `loadURDF` reads the file that is there; at least after `resetSimulation`.
# Seen: files are kept by name for as long as the connection lives. A box rewritten from 1 m to 4 m
# is loaded with 1 m, after `resetSimulation` too; after a new connection it has 4 m.
# So: a loop that writes world.urdf and loads it trains and measures on its first world alone. Give
# each a new name, or `setPhysicsEngineParameter(enableFileCaching=0)` before the first load.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import pybullet as p

path = sys.argv[1] + "/world.urdf"

def write(size):
    open(path, "w").write(f"""<robot name="r"><link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><box size="{size} 1 1"/></geometry></collision></link></robot>""")

def loaded():
    body = p.loadURDF(path)
    low, high = p.getAABB(body)
    p.removeBody(body)
    return round(high[0] - low[0])

p.connect(p.DIRECT)
write(1)
sizes = {"1 m": loaded()}
write(4)
sizes["rewritten as 4 m"] = loaded()
p.resetSimulation()
sizes["after resetSimulation"] = loaded()
p.disconnect()
p.connect(p.DIRECT)
p.setPhysicsEngineParameter(enableFileCaching=0)
sizes["after a new connection"] = loaded()
write(7)
sizes["without caching, rewritten as 7 m"] = loaded()
print(sizes)
if list(sizes.values()) != [1, 1, 1, 4, 7]:
    sys.exit("changed: sizes are %s" % sizes)
PY
