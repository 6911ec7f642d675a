#!/usr/bin/env bash
# sdformat 12.3.0 (Debian 12): an element with a spelling mistake is no error, and its value is the
# default: a laser of 10 Hz and 30 m is one of any rate that sees up to 0 m.
#
# Expected: an element that SDF does not know (`<update_rat>`, or `<maximum>` for `<max>`) is among
# the errors that `Root::Load` returns, since the specification names all elements, or is warned of.
# Seen: there are no errors and no output; the update rate is 0, "as fast as possible", the range
# ends at 0. A required element that is left out has its default in the same silence.
# So: compare the names of a file's elements with those of the specification (the folder `1.9` of
# the package sdformat-sdf) before loading, and print what was read.
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
  for (const auto &[rate, range] : {std::pair{"update_rate", "max"}, {"update_rat", "maximum"}}) {
    const auto element = [](std::string name, int value) { return "<" + name + ">" + std::to_string(value) + "</" + name + ">"; };
    sdf::Root root;
    const auto errors = root.LoadSdfString(R"(<sdf version="1.9"><model name="m"><link name="l"><sensor name="s" type="gpu_lidar">)" +
      element(rate, 10) + "<lidar><scan><horizontal><samples>9</samples><min_angle>-1</min_angle><max_angle>1</max_angle>"
      "</horizontal></scan><range><min>0.1</min>" + element(range, 30) + "</range></lidar></sensor></link></model></sdf>");
    const sdf::Sensor *sensor = root.Model()->LinkByIndex(0)->SensorByIndex(0);
    std::cout << rate << ", " << range << ": errors " << errors.size() << " rate " << sensor->UpdateRate() << " range "
              << sensor->LidarSensor()->RangeMax() << "\n";
  }
}
CC
g++ -std=c++17 read.cc -o read -I$include/sdformat-12.3 -I$include/ignition/math6 -I$include/ignition/utils1 \
    -L"$library" -lsdformat12 -lignition-math6 -Wl,--allow-shlib-undefined
HOME=$dir ./read 2>&1 | tee found
[ "$(cat found)" = "update_rate, max: errors 0 rate 10 range 30
update_rat, maximum: errors 0 rate 0 range 0" ] || { echo "changed: it is read or reported otherwise" >&2; exit 1; }
