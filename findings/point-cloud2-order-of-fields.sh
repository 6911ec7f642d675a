#!/usr/bin/env bash
# sensor_msgs 1.13.1 (Debian 12): `read_points(cloud, field_names=("z", "x"))` gives x first, and a
# field that the cloud lacks is left out of each point.
#
# Expected: the values are in the order that was asked for (each point is a bare tuple), and a name
# that is not in the cloud is an error.
# Seen: the order is that of the fields in the cloud, whatever was asked; asked for x and a
# misspelt `intensty`, each point is a tuple of one; asked for the misspelt one alone, of none.
# `skip_nans` then skips by the fields asked for only: a point whose y is NaN is there if y was not.
# So: take the values by name from `read_points_list`, or `dict(zip(names, point))` with the names
# in the cloud's order; a driver that writes intensity before z changes what comes out.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-sensor-msgs=1.13.1-1 python3-rospy >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - <<'PY'
import math
import sys
from sensor_msgs.msg import PointField
from sensor_msgs.point_cloud2 import create_cloud, read_points
from std_msgs.msg import Header

fields = [PointField(name, 4 * at, PointField.FLOAT32, 1) for at, name in enumerate(("x", "y", "z", "intensity"))]
cloud = create_cloud(Header(), fields, [(1, 2, 3, 40), (5, math.nan, 7, 80)])
found = {names: list(read_points(cloud, field_names=names)) for names in
         (("x", "z"), ("z", "x"), ("x", "intensty"), ("intensty",))}
found["z, x without NaN"] = list(read_points(cloud, skip_nans=True, field_names=("z", "x")))
for names, points in found.items():
    print(names, "->", points)
pairs = [(1.0, 3.0), (5.0, 7.0)]
if found[("x", "z")] != pairs or found[("z", "x")] != pairs or found["z, x without NaN"] != pairs:
    sys.exit("changed: %s" % found)
if found[("x", "intensty")] != [(1.0,), (5.0,)] or found[("intensty",)] != [(), ()]:
    sys.exit("changed: a name that is not there gives %s" % found)
PY
