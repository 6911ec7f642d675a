#!/usr/bin/env bash
# CloudCompare 2.11.3 (Debian 12): from the command line points in UTM lie on steps of half a metre,
# and the normals of a level floor are colours.
#
# Expected: a conversion of a text file to a text file keeps four decimals, as `-PREC 4` says; the
# window proposes a shift for large coordinates. Six columns of one scanner mean one thing.
# Seen: `-O file` without `-GLOBAL_SHIFT AUTO` asks for no shift, and coordinates are floats: of
# 5335000.25 and 5335000.875 m north 5335000.0 and 5335001.0 are left, without a warning. With the
# option all is right. Columns 4 to 6 are normals, if a decimal point is seen in the first line, and
# colours if not: a floor that is written `x y z 0 0 1` gets 1/255 of blue and no normals. Written
# `0.0 0.0 1.0` they are normals, and (0.001, 0.001, 1).
# So: `-GLOBAL_SHIFT AUTO` (or FIRST) behind each `-O`; write normals with a decimal point.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root home
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" -o Dir::State::status=/dev/null cloudcompare=2.11.3-7.1 >/dev/null 2>&1
find debs -name '*.deb' ! -name 'libc6_*' ! -name 'libstdc++6_*' ! -name 'libgcc-s1_*' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library/cloudcompare:$library:$library/blas:$library/lapack:$dir/root/lib/x86_64-linux-gnu
export QT_QPA_PLATFORM=offscreen QT_QPA_PLATFORM_PLUGIN_PATH=$library/qt5/plugins/platforms HOME=$dir/home
convert() {  # options of -O, then a text file
    "$dir/root/usr/bin/CloudCompare" -SILENT -AUTO_SAVE OFF -C_EXPORT_FMT ASC -PREC 4 -ADD_HEADER -O $1 "$2" \
        -SAVE_CLOUDS FILE out.asc >log 2>&1 || { tail -3 log; exit 1; }
    tr -d '\r' <out.asc
}
printf '691000.125 5335000.25 500.5\n691001.375 5335000.5 500.75\n691002.625 5335000.875 501\n' >utm.xyz
printf '0 0 0 0 0 1\n1 0 0 0 0 1\n' >whole.xyz
printf '0 0 0 0.0 0.0 1.0\n1 0 0 0.0 0.0 1.0\n' >points.xyz
plain=$(convert "" utm.xyz) shifted=$(convert "-GLOBAL_SHIFT AUTO" utm.xyz) whole=$(convert "" whole.xyz) points=$(convert "" points.xyz)
for found in "$plain" "$shifted" "$whole" "$points"; do echo "$found"; done
north() { echo "$1" | awk 'NR > 1 {printf "%s ", $2}'; }
[ "$(north "$plain")" = "5335000.0000 5335000.5000 5335001.0000 " ] &&
    [ "$(north "$shifted")" = "5335000.2500 5335000.5000 5335000.8750 " ] || { echo "changed: coordinates" >&2; exit 1; }
case "$whole$points" in
*"R G B"*"Nx Ny Nz"*) ;;
*) echo "changed: columns are taken otherwise" >&2; exit 1 ;;
esac
