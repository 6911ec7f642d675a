#!/usr/bin/env bash
# PLYLoader of three 0.187.0 leaves out every face of more than four corners.
#
# Expected: a PLY face is a list of any length; a viewer cuts it into triangles, as it does with
# quads, or says that it cannot.
# Seen: a pentagon or a hexagon is not there, with no warning; its corners are. A floor plan that
# was extruded has walls (quads) and neither floor nor ceiling. If all faces are larger, the
# geometry has no index and is drawn as a soup of triangles of consecutive vertices.
# So: triangulate before writing PLY for the web (concave faces need it anyway).
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund three@0.187.0 >/dev/null
cat > read.mjs <<'JS'
import {PLYLoader} from 'three/examples/jsm/loaders/PLYLoader.js';
function read(faces) {
  const text = ['ply', 'format ascii 1.0', 'element vertex 6', 'property float x', 'property float y', 'property float z',
    `element face ${faces.length}`, 'property list uchar int vertex_indices', 'end_header',
    '0 0 0', '2 0 0', '3 1 0', '2 2 0', '0 2 0', '-1 1 0', ...faces.map((face) => `${face.length} ${face.join(' ')}`), ''].join('\n');
  const geometry = new PLYLoader().parse(text);
  return geometry.index ? geometry.index.count / 3 : null;
}
const found = {
  triangle: read([[0, 1, 2]]), 'and a quad': read([[0, 1, 2], [0, 1, 3, 4]]),
  'and a pentagon': read([[0, 1, 2], [0, 1, 2, 3, 4]]), 'a hexagon alone': read([[0, 1, 2, 3, 4, 5]]),
};
console.log('triangles:', found);
if (JSON.stringify(Object.values(found)) !== '[1,3,1,null]') {
  console.error('changed: triangles are ' + JSON.stringify(found));
  process.exit(1);
}
JS
node read.mjs
