#!/usr/bin/env bash
# One packet of a VLP-16 in velodyne-decoder 3.1.0 and @foxglove/velodyne-cloud 1.0.1: ring 1 looks
# down by 13 degrees, or up by 1.
#
# Expected: `ring` counts the lines from the lowest to the highest, as in the clouds of the ROS
# driver that LiDAR odometry is written for; each firing has its own azimuth and time.
# Seen: in JavaScript `ring` is the number of the laser as it fires (elevations -15, 1, -13, 3 ...),
# and the 32 firings of a block share one azimuth, though the head turns between them: at 1200 turns
# per minute the later sequence of a block is 0.4 degrees behind. Python sorts the rings and turns
# each firing.
# So: sort the lines by elevation before segmenting a cloud that a viewer made; do not undistort it
# by its azimuths.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check velodyne-decoder==3.1.0
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund @foxglove/velodyne-cloud@1.0.1 >/dev/null
"$dir/venv/bin/python" - <<'PY'
import struct
import sys
import numpy as np
import velodyne_decoder as decoder

packet = b"".join(struct.pack("<HH", 0xEEFF, 80 * block) + struct.pack("<HB", 5000, 100) * 32 for block in range(12))
packet += struct.pack("<I", 1_000_000) + bytes([0x37, 0x22])
open("packet.bin", "wb").write(packet)
config = decoder.Config()
config.model, config.min_range, config.max_range = decoder.Model.VLP16, 0.1, 200
packets = decoder.PacketVector()
packets.append(decoder.VelodynePacket(0.0, list(packet)))
points = decoder.ScanDecoder(config).decode(packets, True)[1][:32]
elevation = np.degrees(np.arctan2(points["z"], np.hypot(points["x"], points["y"])))
rings = [round(float(elevation[points["ring"] == ring][0])) for ring in range(16)]
azimuth = -np.degrees(np.arctan2(points["y"], points["x"]))
behind = round(float(azimuth[16] - azimuth[0]), 2)
print("Python:     elevations of rings 0 .. 15:", rings, "| azimuth of the later sequence:", behind)
if rings != sorted(rings) or rings[1] != -13 or not 0.3 < behind < 0.5:
    sys.exit("changed: rings are %s, the azimuth is %s" % (rings, behind))
PY
cat > read.mjs <<'JS'
import fs from 'node:fs';
import * as module from '@foxglove/velodyne-cloud';
const {Calibration, PointCloud, RawPacket, Transformer} = module.default ?? module;
const packet = new RawPacket(new Uint8Array(fs.readFileSync('packet.bin'))), stamp = {sec: 0, nsec: 0};
const cloud = new PointCloud({stamp, maxPoints: 384});
new Transformer(new Calibration(packet.inferModel())).unpack(packet, stamp, undefined, cloud);
cloud.trim();
const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.byteLength);
const offset = Object.fromEntries(cloud.fields.map((field) => [field.name, field.offset]));
const points = Array.from({length: 32}, (_, index) => {
  const at = (name) => index * cloud.point_step + offset[name];
  const [x, y, z] = ['x', 'y', 'z'].map((name) => view.getFloat32(at(name), true));
  return {ring: view.getUint16(at('ring'), true), elevation: Math.atan2(z, Math.hypot(x, y)), azimuth: Math.atan2(-y, x)};
});
const degrees = (angle) => angle * 180 / Math.PI;
const rings = Array.from({length: 16}, (_, ring) => Math.round(degrees(points.find((point) => point.ring === ring).elevation)));
const behind = degrees(points[16].azimuth - points[0].azimuth);
console.log('JavaScript: elevations of rings 0 .. 15:', rings.join(' '), '| azimuth of the later sequence:', behind.toFixed(2));
if (rings.slice(0, 4).join() !== '-15,1,-13,3' || Math.abs(behind) > 0.01) {
  console.error(`changed: rings are ${rings}, the azimuth is ${behind}`);
  process.exit(1);
}
JS
node read.mjs
