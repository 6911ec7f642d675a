#!/usr/bin/env bash
# pcl-tools 1.13.0 (Debian 12): pcl_pcd2ply of a cloud whose rgb has TYPE U, as Open3D writes it, is
# a PLY file that contradicts its own header.
#
# Expected: `FIELDS x y z rgb`, TYPE U or F, is three properties uchar red, green and blue in PLY,
# and three numbers in each line (in a binary file, three bytes).
# Seen: of TYPE F it is. Of TYPE U the header says the same, and each line has the packed colour as
# one number: 6537556 instead of 99 193 84. A binary file has four bytes for three, so that every
# later point is read from shifted bytes; readers that do not check give coordinates of 1e38.
# So: set TYPE F before the conversion (the bytes stay), or convert with another program; check the
# bounds of a cloud after each conversion.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" pcl-tools=1.13.0+dfsg-3 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack:$dir/root/usr/lib PATH="$dir/root/usr/bin:$PATH"
for type in U F; do
    python3 - "$type" <<'PY'
import struct
import sys

head = ("VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F %s\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA binary\n" % sys.argv[1])
points = b"".join(struct.pack("<fffBBBB", *place, 84, 193, 99, 0) for place in ((1, 2, 3), (4, 5, 6)))
open(sys.argv[1] + ".pcd", "wb").write(head.encode() + points)
PY
    pcl_pcd2ply -format 0 -use_camera 0 $type.pcd $type.ply >/dev/null 2>&1
    pcl_pcd2ply -format 1 -use_camera 0 $type.pcd ${type}_binary.ply >/dev/null 2>&1
done
python3 - <<'PY'
import sys

def file(name):
    head, data = open(name, "rb").read().split(b"end_header\n")
    colours = [line for line in head.decode().split("\n") if line.startswith("property uchar")]
    return colours, data

found = {}
for kind in "UF":
    colours, text = file(kind + ".ply")
    _, data = file(kind + "_binary.ply")
    first = text.decode().split("\n")[0].split()
    found[kind] = (len(colours), first[3:], len(data) - 2 * (3 * 4 + 3))
    print(f"TYPE {kind}: {found[kind][0]} properties of colours, values {first[3:]}, {found[kind][2]} bytes too many")
if found["F"][:2] != (3, ["99", "193", "84"]):
    sys.exit("changed: TYPE F gives %s" % (found["F"],))
if found["U"][0] != 3 or found["U"][1] != [str(99 << 16 | 193 << 8 | 84)]:
    sys.exit("changed: TYPE U gives %s" % (found["U"],))
PY
