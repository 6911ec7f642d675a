#!/usr/bin/env bash
# tf2_sensor_msgs 0.7.6 of Python (Debian 12): of a cloud whose fields are intensity, x, y, z it
# turns intensity, x and y.
#
# Expected: `do_transform_cloud` moves the fields named x, y and z, as the C++ function of the same
# name does; normals turn, an organised cloud stays organised, and the stamp is that of the scan.
# Seen: the first three fields are taken for x, y and z, whatever their names: point (1, 2, 3) with
# intensity 40, a quarter turn and 10 m to the side is (40, 2, 3) with intensity 9 instead of (8, 1,
# 3). normal_x and its like keep their values. Of 2 rows of 3 points 1 row of 6 is left, so that
# row and column of a depth image are gone. The stamp becomes that of the transform: a scan of 100 s
# that is moved by a transform of 7 s is one of 7 s.
# So: read the names in `cloud.fields`, transform with NumPy, and set stamp, height and width anew.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-tf2-sensor-msgs=0.7.6-1 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - <<'PY'
import math
import sys
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import PointField
from sensor_msgs.point_cloud2 import create_cloud, read_points
from std_msgs.msg import Header
from tf2_sensor_msgs.tf2_sensor_msgs import do_transform_cloud

turn = TransformStamped()
turn.header.frame_id, turn.header.stamp = "map", rospy.Time(7)
turn.transform.translation.x = 10
turn.transform.rotation.z = turn.transform.rotation.w = math.sqrt(0.5)

def cloud(names, points):
    fields = [PointField(name, 4 * at, PointField.FLOAT32, 1) for at, name in enumerate(names)]
    return create_cloud(Header(stamp=rospy.Time(100), frame_id="lidar"), fields, points)

def moved(names, point):
    result = do_transform_cloud(cloud(names, [point]), turn)
    values = {name: round(value, 3) for name, value in zip(names, next(read_points(result)))}
    print(" ".join(names), point, "->", values, "at", result.header.stamp.secs, "s")
    return values, result.header.stamp.secs

first = moved(("x", "y", "z", "intensity"), (1, 2, 3, 40))
last = moved(("intensity", "x", "y", "z"), (40, 1, 2, 3))
normal = moved(("x", "y", "z", "normal_x", "normal_y", "normal_z"), (1, 2, 3, 1, 0, 0))[0]
rows = cloud("xyz", [(at, 0, 0) for at in range(6)])
rows.height, rows.width, rows.row_step = 2, 3, 36
flat = do_transform_cloud(rows, turn)
print("height x width: %d x %d -> %d x %d" % (rows.height, rows.width, flat.height, flat.width))
if first != ({"x": 8, "y": 1, "z": 3, "intensity": 40}, 7) or last[0] != {"intensity": 9, "x": 40, "y": 2, "z": 3}:
    sys.exit("changed: points are %s and %s" % (first, last))
if (normal["normal_x"], normal["normal_y"]) != (1, 0) or (flat.height, flat.width) != (1, 6):
    sys.exit("changed: normal %s, %d rows" % (normal, flat.height))
PY
