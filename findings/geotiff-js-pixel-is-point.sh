#!/usr/bin/env bash
# geotiff 3.0.5 (npm) beside rasterio 1.4.4: of one terrain the bounds are half a cell to the south
# east, if its cells are points.
#
# Expected: `getBoundingBox` of a GeoTIFF is the area that its cells cover, with either raster type
# (area or point) the one that GDAL gives.
# Seen: two files of one raster, cells of 10 m, have one extent in GDAL. In JavaScript the one whose
# heights are points (as of SRTM and of many heightmaps) has the centre of its first cell as its
# corner: left and right are 5 m too far east, top and bottom 5 m too far south, and `getOrigin`
# moves with them. `pixelIsArea()` tells the two apart.
# So: without `pixelIsArea()` take half a cell off, towards the north west, before placing terrain.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check rasterio==1.4.4 numpy==2.4.6
npm init -y >/dev/null
npm install --silent --no-audit --no-fund --ignore-scripts geotiff@3.0.5 >/dev/null
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import rasterio
from rasterio.transform import from_origin

for kind in ("Area", "Point"):
    shape = dict(width=4, height=3, count=1, dtype="float32", crs="EPSG:32632", transform=from_origin(500_000, 5_000_000, 10, 10))
    with rasterio.open(f"{kind}.tif", "w", driver="GTiff", **shape) as file:
        file.write(np.arange(12, dtype=np.float32).reshape(1, 3, 4))
        file.update_tags(AREA_OR_POINT=kind)
    bounds = tuple(rasterio.open(f"{kind}.tif").bounds)
    print(f"rasterio,   {kind}: {bounds}")
    if bounds != (500_000, 4_999_970, 500_040, 5_000_000):
        sys.exit("changed: bounds of rasterio are %s" % (bounds,))
PY
cat > read.mjs <<'JS'
import {fromFile} from 'geotiff';
const found = [];
for (const kind of ['Area', 'Point']) {
  const image = await (await fromFile(`${kind}.tif`)).getImage();
  found.push(image.getBoundingBox().join());
  console.log(`JavaScript, ${kind}: ${found.at(-1)}`);
}
if (found.join(' ') !== '500000,4999970,500040,5000000 500005,4999965,500045,4999995') {
  console.error('changed: bounds are ' + found);
  process.exit(1);
}
process.exit(0);
JS
node read.mjs
