#!/usr/bin/env bash
# laser_geometry 1.6.7 (Debian 12): a wall at exactly the maximum range is not in the cloud, one at
# exactly the minimum range is, and a larger cut-off does not help.
#
# Expected: REP 117 and the comments of sensor_msgs/LaserScan call a range valid if it is not below
# `range_min` and not above `range_max`; so both ends are projected.
# Seen: the lower end is compared with "at least", the upper with "less than": of 0.5, 29.99 and
# 30 m with limits of 0.5 and 30 m, the last is left out. `range_cutoff=31` is clamped to
# `range_max` and changes nothing; `range_cutoff=29.99` drops the point at 29.99 m.
# So: a simulated scan whose ranges are rounded to whole steps loses the points on its last step;
# publish a `range_max` a little above the last range that is meant to count.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-laser-geometry=1.6.7-5 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - <<'PY'
import math
import sys
from laser_geometry import LaserProjection
from sensor_msgs.msg import LaserScan
from sensor_msgs.point_cloud2 import read_points

def kept(**limits):
    scan = LaserScan(range_min=0.5, range_max=30.0, angle_increment=0.1)
    scan.ranges = [0.49, 0.5, 29.99, 30.0, 30.01, math.inf]
    return [round(math.hypot(*point[:2]), 2) for point in read_points(LaserProjection().projectLaser(scan, **limits))]

found = {"none": kept(), "31": kept(range_cutoff=31.0), "29.99": kept(range_cutoff=29.99)}
for cutoff, ranges in found.items():
    print(f"limits 0.5 and 30 m, cut-off {cutoff}: {ranges}")
if found != {"none": [0.5, 29.99], "31": [0.5, 29.99], "29.99": [0.5]}:
    sys.exit("changed: kept are %s" % found)
PY
