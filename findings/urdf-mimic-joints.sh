#!/usr/bin/env bash
# One URDF with a coupled joint, three readers, three poses: yourdfpy 0.0.60, urchin 0.0.30 and
# pytransform3d 3.17.0.
#
# Expected: `<mimic joint="a" multiplier="2" offset="0.1"/>` sets a joint to 2 a + 0.1; one that
# mimics a joint that mimics another follows as well (urdf/XML/joint excludes neither).
# Seen: pytransform3d reads the file and leaves `mimic` out without a word: the joint stays at 0.
# yourdfpy and urchin do the first coupling; for the second in the chain urchin silently leaves 0,
# yourdfpy logs that it assumes the offset.
# So: publish the angles of all joints of a gripper or a flipper, not only of the driven ones,
# or resolve mimics yourself before handing the pose on.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check urchin==0.0.30 yourdfpy==0.0.60 pytransform3d==3.17.0
"$dir/venv/bin/python" - "$dir" <<'PY'
import logging
import sys
import warnings

warnings.simplefilter("ignore")
logging.disable(logging.CRITICAL)
import numpy as np
import urchin
import yourdfpy
from pytransform3d.urdf import UrdfTransformManager

def joint(name, parent, child, mimic=""):
    return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>{mimic}</joint>"""

text = f"""<robot name="r"><link name="base"/><link name="one"/><link name="two"/><link name="three"/>
    {joint("a", "base", "one")}{joint("b", "one", "two", '<mimic joint="a" multiplier="2" offset="0.1"/>')}
    {joint("c", "two", "three", '<mimic joint="b" multiplier="1" offset="0.2"/>')}</robot>"""
path = sys.argv[1] + "/robot.urdf"
open(path, "w").write(text)
heading = lambda matrix: float(np.arctan2(matrix[1, 0], matrix[0, 0]))

def angles(pose):
    headings = [heading(pose(link)) for link in ("one", "two", "three")]
    return [round(headings[0], 3)] + [round(float(step), 3) for step in np.diff(headings)]

first = yourdfpy.URDF.load(path)
first.update_cfg({"a": 0.3})
second = urchin.URDF.load(path).link_fk(cfg={"a": 0.3}, use_names=True)
third = UrdfTransformManager()
third.load_urdf(text)
third.set_joint("a", 0.3)
found = {
    "yourdfpy": angles(lambda link: first.get_transform(link, "base")),
    "urchin": angles(lambda link: second[link]),
    "pytransform3d": angles(lambda link: third.get_transform(link, "base")),
}
print("a = 0.3, b = 2 a + 0.1 = 0.7, c = b + 0.2 = 0.9")
for name, values in found.items():
    print(f"{name}: {values}")
if found != {"yourdfpy": [0.3, 0.7, 0.2], "urchin": [0.3, 0.7, 0.0], "pytransform3d": [0.3, 0.0, 0.0]}:
    sys.exit("changed: angles are %s" % found)
PY
