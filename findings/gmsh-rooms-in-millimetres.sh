#!/usr/bin/env bash
# gmsh 4.8.4 (Debian 12): a room of 10 m leaves as STEP of 10 mm, and one of 10 m in STEP comes in
# as 10000.
#
# Expected: gmsh has no units ("10" is what the user means by it), and keeps the number on the way
# out and in; a file that names its unit is read in that unit, or scaled to metres.
# Seen: what it writes says MILLI METRE: trimesh 5.2.0 (cascadio 0.1.1), which gives metres as glTF
# asks, has a room of 1 cm. What is read is converted to millimetres: from a file in metres a room
# of 10 m has 10000 in a mesh (STL) that names no unit. gmsh reads its own file as 10: a round trip
# shows nothing. With `Geometry.OCCTargetUnit` = "M" both ways are right.
# So: set that option, and compare bounds in a second program.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check trimesh==5.2.0 cascadio==0.1.1
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" -o Dir::State::status=/dev/null gmsh=4.8.4+ds2-3 >/dev/null 2>&1
find debs -name '*.deb' ! -name 'libc6_*' ! -name 'libstdc++6_*' ! -name 'libgcc-s1_*' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
mesher() {
    LD_LIBRARY_PATH=$library:$library/blas:$library/lapack:$library/openmpi/lib:$dir/root/lib/x86_64-linux-gnu \
        "$dir/root/usr/bin/gmsh" -v 1 "$@" >log 2>&1 || { tail -3 log; exit 1; }
}
metres() { mesher "$@" -setstring Geometry.OCCTargetUnit M; }
printf 'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 10, 10, 3};\n' >room.geo
mesher room.geo -0 -o plain.step -format step
metres room.geo -0 -o told.step -format step
sed 's/SI_UNIT(.MILLI.,.METRE.)/SI_UNIT($,.METRE.)/' plain.step >metres.step
for read in plain metres; do mesher $read.step -2 -clmax 20000 -o $read.stl -format stl; done
metres metres.step -2 -clmax 20000 -o told.stl -format stl
"$dir/venv/bin/python" - <<'PY'
import sys
import trimesh

found = {name: [float(round(extent, 6)) for extent in trimesh.load(name).extents] for name in
         ("plain.step", "told.step", "metres.step", "plain.stl", "metres.stl", "told.stl")}
said = {"plain.step": "written by gmsh, in metres", "told.step": "written with OCCTargetUnit M, in metres",
        "metres.step": "the same numbers with METRE as unit", "plain.stl": "its own STEP read by gmsh",
        "metres.stl": "STEP in metres read by gmsh", "told.stl": "read with OCCTargetUnit M"}
for name, extents in found.items():
    print(f"{said[name]}: {extents}")
room, tiny, large = [10, 10, 3], [0.01, 0.01, 0.003], [10000, 10000, 3000]
if list(found.values()) != [tiny, room, room, room, large, room]:
    sys.exit("changed: rooms are %s" % found)
PY
