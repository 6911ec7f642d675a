#!/usr/bin/env bash
# cv_bridge 1.16.2 (Debian 12): as 8UC1 the numbers of a 16UC1 image are divided by 256, those of a
# 32FC1 image are not.
#
# Expected: the encodings 8UC1, 16UC1 and 32FC1 are plain numbers, not colours: a conversion between
# them keeps the number where the other type can hold it, or none of them is scaled.
# Seen: labels 3, 200 and 1000 of a segmentation in 16UC1, asked for as 8UC1, are 0, 1 and 4, from
# 32FC1 they are 3, 200 and 255, and from 8UC1 to 16UC1 3 is 771. Depth asked for as 32FC1 keeps the
# number: 1000 mm in 16UC1 becomes 1000, where REP 118 says metres for 32FC1, and 1.9 m in 32FC1
# becomes 2 in 16UC1. `mono8` of 16UC1 is refused as no colour, 8UC1 is not.
# So: take "passthrough" and convert with NumPy, by hand and with units.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-cv-bridge=1.16.2+ds-1+b3 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - <<'PY'
import sys
import numpy as np
from cv_bridge import CvBridge, CvBridgeError

bridge = CvBridge()

def converted(values, kind, source, target):
    image = bridge.imgmsg_to_cv2(bridge.cv2_to_imgmsg(np.array([values], kind), source), target)
    print(source, values, "as", target, image[0].tolist())
    return [round(float(value), 3) for value in image[0]]

labels = [3, 200, 1000]
found = [
    converted(labels, np.uint16, "16UC1", "8UC1"),
    converted(labels, np.float32, "32FC1", "8UC1"),
    converted([3, 200], np.uint8, "8UC1", "16UC1"),
    converted([1000], np.uint16, "16UC1", "32FC1"),
    converted([1.9], np.float32, "32FC1", "16UC1"),
]
if found != [[0, 1, 4], [3, 200, 255], [771, 51400], [1000], [2]]:
    sys.exit("changed: they are %s" % found)
try:
    converted(labels, np.uint16, "16UC1", "mono8")
    sys.exit("changed: mono8 of 16UC1 is not refused")
except CvBridgeError as error:
    print("as mono8:", error)
PY
