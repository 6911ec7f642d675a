#!/usr/bin/env bash
# pybullet 3.2.7: a robot is not where it was loaded, and saving its pose moves it.
#
# Expected: `loadURDF(file, position)` and `getBasePositionAndOrientation` speak of one frame, so
# that what was read can be loaded again.
# Seen: the first takes the frame of the base link, the second gives the centre of mass. With an
# `<inertial>` 0.5 m ahead a robot loaded at x = 1 is reported at 1.5; loaded again there it is at
# 2.0, then 2.5. `resetBasePositionAndOrientation` places the centre of mass as well. For other
# links `getLinkState` gives both.
# So: a true trajectory of the base is off by the lever, turning with the robot; subtract
# getDynamicsInfo(...)[3] (the inertial frame's place) or put the mass at the link's origin.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import pybullet as p

p.connect(p.DIRECT)
path = sys.argv[1] + "/robot.urdf"
open(path, "w").write("""<robot name="r"><link name="base"><inertial><origin xyz="0.5 0 0"/><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision></link></robot>""")
position, told = (1.0, 2.0, 3.0), []
for _ in range(3):
    robot = p.loadURDF(path, position)
    low, high = p.getAABB(robot)
    box = round((low[0] + high[0]) / 2, 3)
    position = p.getBasePositionAndOrientation(robot)[0]
    told.append((box, round(position[0], 3)))
    print(f"loaded: the box's middle is at x = {told[-1][0]}, the pose reported at x = {told[-1][1]}")
    lever = p.getDynamicsInfo(robot, -1)[3]
    p.removeBody(robot)
print("place of the inertial frame:", lever)
if told != [(1.0, 1.5), (1.5, 2.0), (2.0, 2.5)] or lever[0] != 0.5:
    sys.exit("changed: middles and poses are %s, the lever %s" % (told, lever))
PY
