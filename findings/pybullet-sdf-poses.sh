#!/usr/bin/env bash
# pybullet 3.2.7: of an SDF world the pose of a model's first link, `relative_to`, `degrees` and
# nested models are left out, and the world loads.
#
# Expected: `loadSDF` builds the world that the file describes, or fails; SDF 1.7 lets a pose name
# its frame, and every link has a pose in its model.
# Seen: a wall whose link stands 2 m from its model's origin stands at the origin; a model that is
# placed relative to another stands at those numbers in the world; 90 degrees are taken as 90
# radians; a model in a model is not there. The pose of a collision is right. Nothing is said.
# So: put all poses into the models and the collisions, in the world's frame and radians, as of SDF
# 1.4; check `getAABB` of each body against the file.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY' >"$dir/out" 2>"$dir/log" || { cat "$dir/out" "$dir/log"; exit 1; }
import sys
import numpy as np
import pybullet

pybullet.connect(pybullet.DIRECT)
BOX = """<inertial><mass>1</mass><inertia><ixx>1</ixx><ixy>0</ixy><ixz>0</ixz><iyy>1</iyy><iyz>0</iyz><izz>1</izz></inertia>
</inertial><collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision>"""

def centres(name, models):
    """Centres of the boxes of all bodies."""
    with open(name + ".sdf", "w") as file:
        file.write(f'<sdf version="1.7"><world name="w">{models}</world></sdf>')
    pybullet.resetSimulation()
    boxes = [pybullet.getAABB(body, -1) for body in pybullet.loadSDF(name + ".sdf")]
    return [(np.mean(box, axis=0).round(2) + 0.0).tolist() for box in boxes]

def model(name, pose, link, inside=""):
    return f'<model name="{name}"><static>1</static><pose{pose}</pose><link name="a"><pose{link}</pose>{BOX}</link>{inside}</model>'

here = ">0 0 0 0 0 0"
worlds = {
    "model at x = 4": (model("m", ">4 0 0 0 0 0", here), [[4, 0, 0]]),
    "link at x = 2 in it": (model("m", ">4 0 0 0 0 0", ">2 0 0 0 0 0"), [[4, 0, 0]]),
    "1 m from a model at x = 4": (
        model("m", ">4 0 0 0 0 0", here) + model("n", ' relative_to="m">1 0 0 0 0 0', here), [[4, 0, 0], [1, 0, 0]]),
    "a model inside, at y = 9": (
        model("m", here, here, model("k", ">0 9 0 0 0 0", here)), [[0, 0, 0]]),
}
for number, (name, (models, expected)) in enumerate(worlds.items()):
    found = centres(f"world{number}", models)
    print(f"{name}: boxes at {found}")
    if found != expected:
        sys.exit("changed: boxes are at %s" % found)
centres("degrees", model("m", ' degrees="true">0 0 0 0 0 90', here))
yaw = pybullet.getEulerFromQuaternion(pybullet.getBasePositionAndOrientation(0)[1])[2]
print("90 degrees:", round(float(np.degrees(yaw)), 1))
if abs(np.degrees(yaw) - (np.degrees(90) + 180) % 360 + 180) > 0.1:
    sys.exit("changed: the yaw is %s" % yaw)
PY
grep -v "^pybullet build" "$dir/out"
