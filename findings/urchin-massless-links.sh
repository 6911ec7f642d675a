#!/usr/bin/env bash
# urchin 0.0.30: a frame without a mass weighs 1 kg, and is written back so.
#
# Expected: in a URDF a link without `<inertial>` has no mass (urdf/XML/link: optional, zero mass if
# not specified): it is a frame, of which a sensor head has many. Reading and saving a file keeps
# that.
# Seen: `URDF.load` gives each such link 1 kg and the unit inertia, as if stated, and `save` writes
# them. A robot of 2 kg with three frames weighs 5 kg, in every simulator that reads the saved
# file; yourdfpy 0.0.60 keeps None.
# So: do not rewrite robot descriptions with it; compare the sum of the masses before and after
# any tool.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check urchin==0.0.30 yourdfpy==0.0.60
"$dir/venv/bin/python" - "$dir" <<'PY'
import sys
import warnings
import xml.etree.ElementTree as ElementTree

warnings.simplefilter("ignore")
import urchin
import yourdfpy

path, saved = sys.argv[1] + "/robot.urdf", sys.argv[1] + "/saved.urdf"
frames = ("lidar", "camera", "camera_optical")
joints = "".join(f'<link name="{f}"/><joint name="to_{f}" type="fixed"><parent link="base"/><child link="{f}"/></joint>'
                 for f in frames)
open(path, "w").write(f"""<robot name="r"><link name="base"><inertial><mass value="2"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>{joints}</robot>""")
masses = lambda file: [float(m.get("value")) for m in ElementTree.parse(file).iter("mass")]
robot = urchin.URDF.load(path)
read = {link.name: link.inertial.mass for link in robot.links}
robot.save(saved)
other = {link.name: link.inertial and link.inertial.mass for link in yourdfpy.URDF.load(path).robot.links}
print("in the file:", masses(path), "| urchin:", read, "| saved again:", masses(saved))
print("yourdfpy:", other)
if read != {"base": 2.0, "lidar": 1.0, "camera": 1.0, "camera_optical": 1.0} or sum(masses(saved)) != 5:
    sys.exit("changed: urchin has %s and saves %s" % (read, masses(saved)))
if any(other[f] is not None for f in frames):
    sys.exit("changed: yourdfpy has %s" % other)
PY
