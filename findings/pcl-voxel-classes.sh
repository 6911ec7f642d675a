#!/usr/bin/env bash
# pcl-tools 1.13.0 (Debian 12): downsampling gives points a class that no point had.
#
# Expected: pcl_voxel_grid replaces the points of a cell by one; its place and intensity are means,
# its `label` (an unsigned number) is one of theirs, the commonest as in PCL's own
# `VoxelGrid<PointXYZL>`.
# Seen: every field is averaged: of a point of label 7 and one of label 9 in a cell remains one of
# label 8, of 1 and 5 one of label 3. Rings and point numbers fare alike. And the file's VIEWPOINT,
# the place of the sensor, is the origin afterwards.
# So: downsample per class, or filter for the point nearest to the centre; after this tool a label
# means nothing and normals that are turned to the viewpoint point elsewhere.
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
VIEWPOINT 10 0 0 1 0 0 0
POINTS 4
DATA ascii
0.1 0.1 0.1 10 7
0.2 0.1 0.1 20 9
1.1 0.1 0.1 10 1
1.2 0.1 0.1 20 5
PCD
pcl_voxel_grid scan.pcd cells.pcd -leaf 0.5,0.5,0.5 >/dev/null 2>&1
pcl_convert_pcd_ascii_binary cells.pcd text.pcd 0 >/dev/null 2>&1
echo "fields x y z intensity label:"
sed -n '/^DATA/,$p' text.pcd | tail -n +2
labels=$(sed -n '/^DATA/,$p' text.pcd | awk 'NR > 1 { print $5 }' | sort | tr '\n' ' ')
grep -a ^VIEWPOINT cells.pcd
changed() { echo "changed: $1" >&2; exit 1; }
[ "$labels" = "3 8 " ] || changed "labels of the two cells are $labels"
[ "$(grep -a ^VIEWPOINT cells.pcd)" = "VIEWPOINT 0 0 0 1 0 0 0" ] || changed "the viewpoint is kept"
