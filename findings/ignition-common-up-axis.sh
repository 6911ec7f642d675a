#!/usr/bin/env bash
# ignition-common 4.5.1 (Debian 12), the loader of meshes of Gazebo: COLLADA's <up_axis> is not
# looked at, <unit> is.
#
# Expected: <asset> says how to read the numbers: <unit> how long they are, <up_axis> which of them
# is the height. A tower of 3 m along z in a Z_UP file and one along y in a Y_UP file stand alike.
# Seen: Z_UP, Y_UP and X_UP of the same numbers give the same mesh; centimetres become metres. So
# of two correct files of one tower, one stands and one lies. No message.
# So: export with z up, as Blender's COLLADA does, or turn the mesh by <pose>; a test needs a mesh
# whose extents differ in y and z. (assimp turns by the axis: `mesh-units-and-up-axis.sh`.)
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" libignition-common-graphics-dev=4.5.1+ds-2+b1 libignition-math-dev >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
include=root/usr/include library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library
cat > load.cc <<'CC'
#include <iostream>
#include <ignition/common/Mesh.hh>
#include <ignition/common/MeshManager.hh>
int main(int count, char **names) {
  for (int i = 1; i < count; ++i)
    std::cout << names[i] << ": up to " << ignition::common::MeshManager::Instance()->Load(names[i])->Max() << "\n";
}
CC
g++ -std=c++17 load.cc -o load -I$include/ignition/common4 -I$include/ignition/math6 -I$include/ignition/utils1 -I/usr/include/ignition/math6 \
    -I/usr/include/ignition/utils1 -L"$library" -lignition-common4-graphics -lignition-common4 -lignition-math6 -Wl,--allow-shlib-undefined
for kind in Z_UP-1 Y_UP-1 X_UP-1 Z_UP-0.01; do
    cat > "$kind.dae" <<XML
<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2024-01-01T00:00:00Z</created><modified>2024-01-01T00:00:00Z</modified>
<unit name="u" meter="${kind#*-}"/><up_axis>${kind%-*}</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 2 3</float_array>
<technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
XML
done
HOME=$dir ./load Z_UP-1.dae Y_UP-1.dae X_UP-1.dae Z_UP-0.01.dae | tee found
[ "$(sed 's/.*up to //' found)" = "1 2 3
1 2 3
1 2 3
0.01 0.02 0.03" ] || { echo "changed: the extents are others" >&2; exit 1; }
