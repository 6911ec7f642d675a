#!/usr/bin/env bash
# draco 1.5.5 (Debian 12): the standard options of draco_encoder leave a cloud without intensities
# and put its heights on steps of 10 cm.
#
# Expected: `draco_encoder -point_cloud` compresses a PLY file with its options for precision per
# kind of attribute, so a property of each point is kept or named as left out, and a height within
# 3 m is finer than a position within 200 m.
# Seen: positions get 11 bits for the longest side of the bounding box, so x, y and z share one
# step, 200 m / 2047: the floor and a kerb of 4 cm are one height. The property `intensity` is
# dropped without a word; colours stay. The points come back in another order than they went in.
# So: give `-qp 16` or more for a scan of a street, keep intensities in a colour or in another
# format, and never pair a decoded cloud with arrays by index.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq draco=1.5.5+dfsg-2 libdraco7=1.5.5+dfsg-2 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH="$dir/root/usr/lib/x86_64-linux-gnu" PATH="$dir/root/usr/bin:$PATH"
/usr/bin/python3 - <<'PY'
with open("scan.ply", "w") as file:
    file.write("ply\nformat ascii 1.0\nelement vertex 2001\nproperty float x\nproperty float y\nproperty float z\n")
    file.write("property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float intensity\nend_header\n")
    for index in range(2001):
        file.write("%.3f %.3f %.3f %d %d 0 %.1f\n" % (index * 0.1, index * 7 % 2001 * 0.1, index % 100 * 0.03, index % 256, index // 256, index / 10))
PY
draco_encoder -point_cloud -i scan.ply -o scan.drc > log.txt
draco_decoder -i scan.drc -o back.ply >/dev/null
/usr/bin/python3 - <<'PY'
import struct
import sys

data = open("back.ply", "rb").read()
header, body = data.split(b"end_header\n", 1)
properties = [line.split()[-1].decode() for line in header.splitlines() if line.startswith(b"property")]
points = list(struct.iter_unpack("<fffBBB", body))
heights = sorted({round(point[2], 4) for point in points})
steps = sorted({round(above - below, 3) for below, above in zip(heights, heights[1:])})
order = [point[3] + 256 * point[4] for point in points]
print("properties:", properties, "| a word about intensity:", "ntensity" in open("log.txt").read())
print(len(points), "points have", len(heights), "heights between 0 and 2.97 m, in steps of", steps, "m")
print("the first five points are numbers", order[:5])
if properties != ["x", "y", "z", "red", "green", "blue"]:
    sys.exit("changed: the properties are %s" % properties)
if not 25 <= len(heights) <= 35 or not all(0.09 < step < 0.11 for step in steps):
    sys.exit("changed: the steps are %s" % steps)
if order == sorted(order) or sorted(order) != list(range(2001)):
    sys.exit("changed: the order is kept, or points are lost")
PY
