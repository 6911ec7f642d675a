#!/usr/bin/env bash
# sdformat 12.3.0 (Debian 12): of a URDF whose mast has no mass the mast, the head and the LiDAR on
# it are not there, without an error; a coupled joint moves freely.
#
# Expected: URDF's <inertial> is optional, and frames without a mass are in most robots; a reader
# that cannot simulate them says so, or keeps what stands on them. <mimic> couples joints.
# Seen: `Root::Load` of base, mast (no mass), head and lidar returns no errors and a model of one
# link and no joints; nothing is printed. With 1 g for the mast there are base, mast and head, and
# the LiDAR on its fixed joint is merged into the head. <mimic> is left out: the joint is one of its
# own.
# So: count links before and after, write a small mass into every frame that carries others, and
# `<disableFixedJointLumping>` in a <gazebo> element for what a sensor is attached to.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
apt-get download -qq libsdformat12-12=12.3.0+ds-2 libsdformat-dev=12.3.0+ds-2 sdformat-sdf=12.3.0+ds-2 \
    libignition-math6-6=6.10.0+ds3-7+b4 libignition-math-dev=6.10.0+ds3-7+b4 libignition-utils-dev libignition-cmake-dev \
    libtinyxml2-9 libtinyxml2.6.2v5 liburdfdom-model3.0 libconsole-bridge1.0 2>/dev/null
for package in *.deb; do dpkg -x "$package" root; done
include=root/usr/include library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library SDF_PATH=$dir/root/usr/share/sdformat12
cat > read.cc <<'CC'
#include <iostream>
#include <sdf/sdf.hh>
int main() {
  const auto mass = [](std::string m) { return "<inertial><mass value='" + m + "'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"; };
  const std::string limit = "<axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' velocity='1'/>";
  for (const std::string mast : {"", "0.001"}) {
    sdf::Root root;
    const auto errors = root.LoadSdfString("<robot name='r'><link name='base'>" + mass("10") + "</link><link name='mast'>" + (mast.empty() ? "" : mass(mast)) +
      "</link><link name='head'>" + mass("2") + "</link><link name='lidar'>" + mass("1") + "</link>"
      "<joint name='a' type='revolute'><parent link='base'/><child link='mast'/>" + limit + "</joint>"
      "<joint name='b' type='revolute'><parent link='mast'/><child link='head'/>" + limit + "<mimic joint='a' multiplier='2'/></joint>"
      "<joint name='c' type='fixed'><parent link='head'/><child link='lidar'/></joint></robot>");
    std::cout << "mast of " << (mast.empty() ? "no mass" : mast + " kg") << ": errors " << errors.size() << " links";
    for (std::size_t i = 0; i < root.Model()->LinkCount(); ++i)
      std::cout << " " << root.Model()->LinkByIndex(i)->Name() << "=" << root.Model()->LinkByIndex(i)->Inertial().MassMatrix().Mass();
    std::cout << " joints " << root.Model()->JointCount() << " mimic " << (root.Element()->ToString("").find("mimic") != std::string::npos) << "\n";
  }
}
CC
g++ -std=c++17 read.cc -o read -I$include/sdformat-12.3 -I$include/ignition/math6 -I$include/ignition/utils1 \
    -L"$library" -lsdformat12 -lignition-math6 -Wl,--allow-shlib-undefined
HOME=$dir ./read 2>&1 | tee found
[ "$(cat found)" = "mast of no mass: errors 0 links base=10 joints 0 mimic 0
mast of 0.001 kg: errors 0 links base=10 mast=0.001 head=3 joints 2 mimic 0" ] || { echo "changed: it is read or reported otherwise" >&2; exit 1; }
