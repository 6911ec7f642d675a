#!/usr/bin/env bash
# sdformat 12.3.0 (Debian 12): a camera of 90 degrees and 640 by 480 pixels has the focal length and
# the centre of another picture.
#
# Expected: `Camera::LensIntrinsicsFx` and `Cx`, if the file gives none, follow from its field of
# view and its width: 320 and 320 pixels. If only `fx` is given, `fy` is the same and the centre is
# that of the picture.
# Seen: 277 and 160, the defaults of a camera of 60 degrees and 320 by 240 pixels, whatever the
# picture. With `<fx>320</fx>` alone, `HasLensIntrinsics` is true, `fy` stays 277 and the centre
# (160, 120), a quarter of the picture off, so a cloud from depth leans and squints.
# So: write all of fx, fy, cx and cy, or none; then compute them from `HorizontalFov` and the image.
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
  for (const char *lens : {"", "<lens><intrinsics><fx>320</fx></intrinsics></lens>"}) {
    sdf::Root root;
    const auto errors = root.LoadSdfString(std::string(R"(<sdf version="1.9"><model name="m"><link name="l">
      <sensor name="s" type="camera"><camera><horizontal_fov>1.5707963</horizontal_fov><image><width>640</width>
      <height>480</height></image>)") + lens + "</camera></sensor></link></model></sdf>");
    if (!errors.empty()) return 2;
    const sdf::Camera *camera = root.Model()->LinkByIndex(0)->SensorByIndex(0)->CameraSensor();
    std::cout << camera->ImageWidth() << "x" << camera->ImageHeight() << " fov " << camera->HorizontalFov().Degree()
              << " given " << camera->HasLensIntrinsics() << " fx " << camera->LensIntrinsicsFx() << " fy "
              << camera->LensIntrinsicsFy() << " cx " << camera->LensIntrinsicsCx() << " cy " << camera->LensIntrinsicsCy() << "\n";
  }
}
CC
g++ -std=c++17 read.cc -o read -I$include/sdformat-12.3 -I$include/ignition/math6 -I$include/ignition/utils1 \
    -L"$library" -lsdformat12 -lignition-math6 -Wl,--allow-shlib-undefined
./read | tee found
[ "$(cat found)" = "640x480 fov 90 given 0 fx 277 fy 277 cx 160 cy 120
640x480 fov 90 given 1 fx 320 fy 277 cx 160 cy 120" ] || { echo "changed: the lens is another" >&2; exit 1; }
