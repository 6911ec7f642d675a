#!/usr/bin/env bash
# python3-ignition-math 6.10.0 (Debian 12): two points 0.9 mm apart are equal in space and
# different in the plane.
#
# Expected: `==` of one library compares alike for its types: exactly, or within one tolerance.
# Seen: Vector3d, Pose3d, Quaterniond, Angle and AxisAlignedBox are equal within 0.001 of their
# numbers, a turn by 0.1 degrees among them; Vector2d and Matrix3d of the same numbers differ. Two
# poses are equal while their matrices are not, and equality is not transitive: 0, 0.9, 1.8 mm.
# So: compare with `equal(other, tolerance)` where it exists, and never use `==` of these types to
# see whether a robot moved: at 0.01 m/s and 100 Hz it stands still.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq python3-ignition-math=6.10.0+ds3-7+b4 libignition-math6-6=6.10.0+ds3-7+b4 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH="$dir/root/usr/lib/x86_64-linux-gnu" PYTHONPATH="$dir/root/usr/lib/python3/dist-packages"
/usr/bin/python3 - <<'PY'
import sys
from ignition.math import Angle, AxisAlignedBox, Matrix3d, Pose3d, Quaterniond, Vector2d, Vector3d

d = 0.0009
found = {
    "Vector3d": Vector3d(1, 0, 0) == Vector3d(1 + d, 0, 0),
    "Quaterniond": Quaterniond(0, 0, 0) == Quaterniond(0, 0, 2 * d),
    "Matrix3d": Matrix3d(1, 0, 0, 0, 1, 0, 0, 0, 1) == Matrix3d(1, 0, 0, 0, 1, d, 0, -d, 1),
    "Angle": Angle(0) == Angle(d),
    "AxisAlignedBox": AxisAlignedBox(0, 0, 0, 1, 1, 1) == AxisAlignedBox(0, 0, 0, 1 + d, 1, 1),
    "Vector2d": Vector2d(1, 0) == Vector2d(1 + d, 0),
    "Pose3d": Pose3d(1, 0, 0, 0, 0, 0) == Pose3d(1 + d, 0, 0, 0, 0, 0),
}
print("equal though 0.0009 apart:", ", ".join(name for name, equal in found.items() if equal))
print("not equal:", ", ".join(name for name, equal in found.items() if not equal))
a, b, c = (Vector3d(x, 0, 0) for x in (0, d, 2 * d))
print("0 and 0.9 mm:", a == b, "| 0.9 and 1.8 mm:", b == c, "| 0 and 1.8 mm:", a == c)
if [name for name, equal in found.items() if not equal] != ["Matrix3d", "Vector2d"]:
    sys.exit("changed: equality is %s" % found)
if (a == b, b == c, a == c) != (True, True, False):
    sys.exit("changed: the tolerance of Vector3d is another")
PY
