#!/usr/bin/env bash
# sdformat 12.3.0 (Debian 12): a LiDAR of 1e3 beams has one beam, and noise that is misspelt is
# none, without an error.
#
# Expected: text that is no number of the element's type is refused, as three numbers in <pose>, a
# comma in it, and `<static>yes</static>` are.
# Seen: numbers are read up to the first character that does not fit, and the rest is dropped:
# `<samples>1e3` is 1 and 9.7 is 9, an update rate of 2,5 is 2, of 1/3 is 1; 10Hz is 10 and 0x10 is
# 16. `<noise><type>gausian` is no noise, beside its `stddev`. No errors and no output.
# So: print the numbers back (`LidarSensor()->HorizontalScanSamples()`), and write integers without
# an exponent; a locale with decimal commas in whatever writes the file costs fractions silently.
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
  const auto read = [](std::string rate, std::string samples, std::string noise, std::string pose) {
    sdf::Root root;
    const auto errors = root.LoadSdfString("<sdf version='1.9'><model name='m'><pose>" + pose + "</pose><link name='l'><sensor name='s' type='gpu_lidar'>"
      "<update_rate>" + rate + "</update_rate><lidar><scan><horizontal><samples>" + samples + "</samples><min_angle>-1</min_angle><max_angle>1</max_angle>"
      "</horizontal></scan><range><min>0.1</min><max>30</max></range><noise><type>" + noise + "</type><stddev>0.1</stddev></noise></lidar></sensor></link></model></sdf>");
    std::cout << rate << " " << samples << " " << noise << " pose " << pose << ": ";
    if (!errors.empty()) { std::cout << "refused\n"; return; }
    const sdf::Sensor *sensor = root.Model()->LinkByIndex(0)->SensorByIndex(0);
    std::cout << "rate " << sensor->UpdateRate() << " beams " << sensor->LidarSensor()->HorizontalScanSamples() << " noise "
              << (sensor->LidarSensor()->LidarNoise().Type() == sdf::NoiseType::GAUSSIAN) << "\n";
  };
  read("10", "1000", "gaussian", "0 0 0 0 0 0");
  read("2,5", "1e3", "gaussian", "0 0 0 0 0 0");
  read("1/3", "9.7", "gausian", "0 0 0 0 0 0");
  read("10Hz", "0x10", "gaussian", "0 0 0 0 0 0");
  read("10", "1000", "gaussian", "0 0 0");
}
CC
g++ -std=c++17 read.cc -o read -I$include/sdformat-12.3 -I$include/ignition/math6 -I$include/ignition/utils1 \
    -L"$library" -lsdformat12 -lignition-math6 -Wl,--allow-shlib-undefined
HOME=$dir ./read 2>log | tee found
[ "$(sed 's/.*: //' found)" = "rate 10 beams 1000 noise 1
rate 2 beams 1 noise 1
rate 1 beams 9 noise 0
rate 10 beams 16 noise 1
refused" ] || { echo "changed: they are read or reported otherwise" >&2; exit 1; }
if grep -qE 'samples|rate|noise' log; then echo "changed: there is a message" >&2; exit 1; fi
