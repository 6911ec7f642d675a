#!/usr/bin/env bash
# octomap-tools 1.9.7 (Debian 12): a map of another resolution is a map of another building.
#
# Expected: `edit_octree --res 0.2` ("set resolution of OcTree to new value") resamples a map of
# 0.1 m to cells of 0.2 m, the walls stay where they are; `--scale` is there for another size.
# Seen: the cells keep their keys and only the number in the header changes, so the map doubles: the
# end of a corridor moves from 3.95 m to 7.9 m. `--res 0.2` and `--scale 2` of one map write the
# same file, byte for byte. (`--offset` says that it is not implemented, and writes a file.)
# So: resample by inserting the cells' centres into a new tree; after `edit_octree --res` poses,
# ranges and robots no longer fit the map.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq octomap-tools=1.9.7+dfsg-3+b1 liboctomap1.9=1.9.7+dfsg-3+b1 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
export LD_LIBRARY_PATH="$dir/root/usr/lib/x86_64-linux-gnu" PATH="$dir/root/usr/bin:$PATH"
{ echo "NODE 0 0 0 0 0 0"; echo "3.95 0.05 0.05"; echo "-1.95 0.05 0.05"; } > scan.log
log2graph scan.log scan.graph >/dev/null 2>&1
graph2tree -i scan.graph -o map.bt -res 0.1 >/dev/null 2>&1
edit_octree --res 0.2 -o res.bt map.bt >/dev/null 2>&1
edit_octree --scale 2 -o scale.bt map.bt >/dev/null 2>&1
changed() { echo "changed: $1" >&2; exit 1; }
occupied() {
    bt2vrml "$1" >/dev/null 2>&1
    awk '/translation/ { x = $4 } /size/ { printf "%s(%s) ", x, $9 }' "$1.wrl" | tr -d '{}'
}
before=$(occupied map.bt) after=$(occupied res.bt)
echo "occupied x (size of the cell), map.bt at 0.1 m: $before"
echo "after edit_octree --res 0.2:                    $after"
cmp res.bt scale.bt || changed "--res and --scale differ"
echo "--res 0.2 and --scale 2 write one file"
[ "$before" = "-1.95(0.1) 3.95(0.1) " ] || changed "the map has $before"
[ "$after" = "-3.9(0.2) 7.9(0.2) " ] || changed "the edited map has $after"
