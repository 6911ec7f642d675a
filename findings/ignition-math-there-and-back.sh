#!/usr/bin/env bash
# python3-ignition-math 6.10.0 (Debian 12): a vehicle 100 m to the east has the longitude of one
# 100 m to the west, and a point that is converted to latitude, longitude and back is elsewhere.
#
# Expected: with a heading of 0 and the frame ENU, the default of a world's <spherical_coordinates>,
# x points east, and `local_from_spherical_position` undoes `spherical_from_local_position`, as
# `local_from_global_velocity` does `global_from_local_velocity`.
# Seen: (100, 20, 5) at heading 0 has a longitude of 100 m to the west and comes back as
# (-100, -20, 5); with 30 degrees it comes back as (-67, 77, 5); a velocity of (1, 0, 0) as
# (-1, 0, 0). The frame LOCAL, which these functions use, is turned on one of the two ways only;
# LOCAL2 of `position_transform`, which exists beside it, is right both ways. The names of the
# functions say nothing of it.
# So: convert with LOCAL2; a GPS that is simulated with these functions drives away from its goal,
# and the usual advice, a heading of 180 degrees, mends one direction only.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq python3-ignition-math=6.10.0+ds3-7+b4 libignition-math6-6=6.10.0+ds3-7+b4 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH="$dir/root/usr/lib/x86_64-linux-gnu" PYTHONPATH="$dir/root/usr/lib/python3/dist-packages"
/usr/bin/python3 - <<'PY'
import math
import sys
from ignition.math import Angle, SphericalCoordinates, Vector3d

def tuple_of(vector):
    return tuple(round(value, 1) + 0.0 for value in (vector.x(), vector.y(), vector.z()))

point, found = Vector3d(100, 20, 5), {}
for heading in (0, 30, 90):
    world = SphericalCoordinates(SphericalCoordinates.EARTH_WGS84, Angle(0.8), Angle(0.1), 0, Angle(math.radians(heading)))
    position = world.local_from_spherical_position(world.spherical_from_local_position(point))
    velocity = world.local_from_global_velocity(world.global_from_local_velocity(Vector3d(1, 0, 0)))
    there = world.spherical_from_local_position(point)
    east = round(math.radians(there.y()) * 6_378_137 * math.cos(0.8) - 0.1 * 6_378_137 * math.cos(0.8))
    second = world.position_transform(world.position_transform(point, world.LOCAL2, world.GLOBAL), world.GLOBAL, world.LOCAL2)
    found[heading] = tuple_of(position), tuple_of(velocity), tuple_of(second), east
    print("heading %2d: (100, 20, 5) comes back as %s, a velocity (1, 0, 0) as %s, with LOCAL2 %s; %d m east" % (heading, *found[heading]))
if any(second != (100, 20, 5) for _, _, second, _ in found.values()):
    sys.exit("changed: LOCAL2 does not come back")
if found[0][:2] != ((-100, -20, 5), (-1, 0, 0)) or not -101 < found[0][3] < -99:
    sys.exit("changed: without a heading they are %s" % (found[0],))
if math.dist(found[30][0], (-67.3, 76.6, 5)) > 0.2:
    sys.exit("changed: with 30 degrees it comes back as %s" % (found[30][0],))
PY
