#!/usr/bin/env bash
# pcl-tools 1.13.0 (Debian 12): a filter for 0 to 1 m leaves as many points as there were; a
# transform leaves the coordinates only.
#
# Expected: `pcl_passthrough_filter -field x -min 0 -max 1` writes the points between, and says how
# many; `pcl_transform_point_cloud` moves points and keeps what belongs to them.
# Seen: of four points four remain, "[done, ... : 4 points]": those outside are NaN and keep their
# intensity; a count, or a reader that takes NaN for 0, is wrong. (The API leaves them out by
# default.) After the transform intensity and label are gone, without a message.
# So: drop NaN points after this filter, and transform with a library call; compare FIELDS of both
# files.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" pcl-tools=1.13.0+dfsg-3 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PATH="$dir/root/usr/bin:$PATH"
cat > scan.pcd <<'PCD'
VERSION 0.7
FIELDS x y z intensity label
SIZE 4 4 4 4 4
TYPE F F F F U
COUNT 1 1 1 1 1
WIDTH 4
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 4
DATA ascii
0.1 0.1 0.1 10 7
0.2 0.1 0.1 20 9
5.1 0.1 0.1 30 1
6.2 0.1 0.1 40 2
PCD
pcl_passthrough_filter scan.pcd near.pcd -field x -min 0 -max 1 2>&1 | grep -o '[0-9]* points' | tail -1
pcl_transform_point_cloud scan.pcd moved.pcd -trans 1,0,0 >/dev/null 2>&1
for name in near moved; do
    pcl_convert_pcd_ascii_binary $name.pcd $name.text 0 >/dev/null 2>&1
    echo "$name: $(grep ^FIELDS $name.text)"
    sed -n '/^DATA/,$p' $name.text | tail -n +2
done
changed() { echo "changed: $1" >&2; exit 1; }
[ "$(sed -n '/^DATA/,$p' near.text | tail -n +4)" = "nan nan nan 30 1
nan nan nan 40 2" ] || changed "the filter leaves other points"
grep -q '^FIELDS x y z$' moved.text || changed "the transform keeps $(grep ^FIELDS moved.text)"
