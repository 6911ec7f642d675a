/**
 * Shaders of the walls; see `walls.ts` for what they show.
 *
 * Lighting is per vertex, because rectangles are short, and the seen state per pixel: software
 * rendering spends most of its time in fragment shaders. Fragments are discarded only where the map
 * is cut, so that early depth tests apply otherwise; features that a view does not need are not
 * compiled, because software evaluates both sides of a condition.
 */

import { CORNER_OUTWARD, FRAGMENT_HEAD, NORMALS, PACKED_CORNER, VERTEX_HEAD } from "./glsl.ts";

/** Cell edges are drawn where a cell has at least this many pixels. */
export const CELL_PX_LEAST = 10;

/**
 * Below this opacity walls towards the camera are clear glass, which does not show what has been
 * seen.
 */
export const GLASS_BELOW = 0.4;

const VERTEX = /* glsl */ `${VERTEX_HEAD}${NORMALS}
#ifdef RIM
in vec4 corner;
${CORNER_OUTWARD}
#else
${PACKED_CORNER}
#endif
uniform float cellM;
uniform float opacity;
out vec3 freeCells;
out vec3 positionM;
flat out vec3 stone;
out float haziness;
flat out int facing;

const vec3 STONE = vec3(0.64, 0.44, 0.265);
const vec3 STONE_HIGH = vec3(0.74, 0.60, 0.43);
// Strata, and a slight variation of each rectangle.
vec3 stoneAt(uvec3 at) {
  float layer = abs(fract(float(at.z) * 0.0716) * 2.0 - 1.0);
  uint h = at.x * 73856093u ^ at.y * 19349663u ^ at.z * 83492791u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return mix(STONE, STONE_HIGH, layer) * (0.94 + 0.12 / 255.0 * float((h >> 16) & 255u));
}

// Position of the corners of an omitted rectangle; the condition must be the same for all of them.
const vec4 NOWHERE = vec4(0.0, 0.0, 2.0, 1.0);
// Direction to the middle of the view.
vec3 look() { return -vec3(viewMatrix[0].z, viewMatrix[1].z, viewMatrix[2].z); }

// Rectangles of different lengths meet along edges; half a pixel more on each side closes the gaps.
vec3 widened(vec3 position) {
  int axis = facing >> 1;
  vec2 outward = vec2(cornerOutward(facing));
  vec3 across = axis == 0 ? vec3(0.0, outward) : axis == 1 ? vec3(outward.x, 0.0, outward.y) : vec3(outward, 0.0);
  return position + across * (0.5 * pixelM * distance(eye, position));
}
`;

const VERTEX_PLACE = /* glsl */ `
  #ifdef RIM
  facing = int(corner.w);
  vec3 place = corner.xyz;
  positionM = (modelMatrix * vec4(place, 1.0)).xyz;
  #else
  facing = cornerFacing();
  ivec3 cells = cornerCells();
  vec3 place = vec3(cells);
  positionM = place * cellM;
  #endif
  positionM = widened(positionM);
  gl_Position = projectionMatrix * viewMatrix * vec4(positionM, 1.0);
  vec3 away = positionM - eye;
  float distanceM = length(away);
  away /= distanceM;
  haziness = hazinessAt(distanceM);
  vec3 flatNormal = NORMALS[facing];
  // On the free side of the face, half a cell away from it.
  freeCells = place + flatNormal * 0.5;
  stone = stoneAt(uvec3(place));
`;

/** The direction out of the rock and openness at the corner, and means of its rectangle. */
const VERTEX_OCCLUSION = /* glsl */ `
  uvec4 texel = occlusionTexel(cells);
  vec4 open = occlusionOf(texel);
  vec3 outMean = occlusionOf((texel + otherTexels(cells, facing)) >> 2).xyz;
`;

export const WALL_VERTEX = /* glsl */ `${VERTEX}
out vec3 lit;
#ifdef EDGES
out float edgeWidth;
out float edgeStrength;
#endif
void main() {
  ${VERTEX_PLACE}
  ${VERTEX_OCCLUSION}
  // A step in a wall that as a whole looks away from the camera would float in the air.
  if (dot(outMean, look()) > 0.38) gl_Position = NOWHERE;
  vec3 n = normalize(flatNormal * 0.75 + open.xyz * 0.8);
  float shade = smoothstep(0.08, 0.60, open.a);
  float key = max(dot(n, light) * 0.78 + 0.22, 0.0);
  float fill = max(-dot(n, away), 0.0);
  float sky = 0.5 + 0.5 * n.z;
  lit = vec3(0.15, 0.175, 0.23) * mix(0.4, 1.0, sky) + vec3(0.16, 0.14, 0.13) * fill + vec3(1.26, 1.12, 0.95) * key * key;
  lit *= mix(0.16, 1.15, shade);
  #ifdef EDGES
  float pixel = pixelM * distanceM / cellM;
  edgeWidth = max(0.03, 1.5 * pixel);
  edgeStrength = 0.28 * (1.0 - smoothstep(0.35, 1.0, pixel * ${CELL_PX_LEAST.toFixed(1)}));
  #endif
}
`;

export const WALL_SHELL_VERTEX = /* glsl */ `${VERTEX}
out vec3 lit;
out float alpha;
void main() {
  ${VERTEX_PLACE}
  ${VERTEX_OCCLUSION}
  vec3 n = normalize(flatNormal * 0.2 + open.xyz);
  // The rock's side of the face; glass is clearest where one looks straight through.
  float glance = 1.0 - abs(dot(n, away));
  float key = max(dot(-mix(n, flatNormal, 0.4 + 0.6 * opacity), light), 0.0);
  lit = vec3(0.24, 0.28, 0.36) + vec3(1.1, 1.0, 0.88) * key * key;
  // Glass that would be invisible is omitted.
  float glanceMean = 1.0 - abs(dot(normalize(flatNormal * 0.2 + outMean), look()));
  if (opacity < ${GLASS_BELOW.toFixed(2)} && glanceMean < 0.35) gl_Position = NOWHERE;
  alpha = mix(opacity * (0.1 + 2.6 * glance * glance * glance), 1.0, opacity * opacity);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}${NORMALS}
in vec3 freeCells;
in vec3 positionM;
flat in vec3 stone;
in float haziness;
flat in int facing;
uniform usampler3D times;
uniform usampler3D known;
uniform vec3 knownColour;
uniform float heatScale;
uniform sampler2D heat;

const vec3 NIGHT = vec3(0.058, 0.092, 0.180);

// What has no time yet is 0 in a volume, and later than any tick here.
uint timeIn(usampler3D volume, ivec3 cell) { return texelFetch(volume, cell, 0).r - 1u; }
// Unlit colour of the wall in front of a free cell.
vec3 surface() {
  ivec3 cell = ivec3(freeCells);
  uint seen = timeIn(times, cell);
  #ifdef HEAT
  vec3 c = square(texture(heat, vec2(sqrt(float(seen) * heatScale), 0.5)).rgb) * 0.9;
  #else
  vec3 c = stone;
  #ifdef KNOWN
  uint knownTick = timeIn(known, cell);
  c = knownTick > nowTick ? c * 0.16 + NIGHT * 0.5 : mix(c, knownColour, 0.42);
  #endif
  // What was seen recently glows for some seconds.
  float fresh = max(1.0 - float(nowTick - seen) * 0.004, 0.0);
  c *= 1.0 + 0.5 * fresh * fresh;
  #endif
  return seen > nowTick ? NIGHT : c;
}
`;

export const WALL_FRAGMENT = /* glsl */ `${FRAGMENT}
in vec3 lit;
#ifdef EDGES
in float edgeWidth;
in float edgeStrength;
#endif
void main() {
  #ifdef CUT
  if (isCut(positionM)) discard;
  #endif
  vec3 c = surface() * lit;
  #ifdef EDGES
  vec3 off = abs(fract(freeCells) - 0.5) * (1.0 - abs(NORMALS[facing]));
  float edge = max(off.x, max(off.y, off.z));
  c *= 1.0 - edgeStrength * smoothstep(0.5 - edgeWidth, 0.5, edge);
  #endif
  colour = vec4(shown(mix(c, hazeColour(), haziness)), 1.0);
}
`;

export const WALL_SHELL_FRAGMENT = /* glsl */ `${FRAGMENT}
in vec3 lit;
in float alpha;
void main() {
  #ifdef CUT
  if (isCut(positionM)) discard;
  #endif
  #ifdef GLASS
  vec3 c = vec3(0.34, 0.32, 0.31) * lit;
  #else
  vec3 c = surface() * lit;
  #endif
  colour = vec4(shown(mix(c, hazeColour(), haziness)), min(alpha, 1.0));
}
`;

export const RIM_VERTEX = /* glsl */ `${VERTEX}
void main() {
  ${VERTEX_PLACE}
}
`;

export const RIM_FRAGMENT = /* glsl */ `${FRAGMENT}
void main() {
  float key = max(dot(NORMALS[facing], light), 0.0);
  vec3 c = vec3(0.070, 0.084, 0.115) * (0.7 + 0.6 * key);
  colour = vec4(shown(mix(c, hazeColour(), haziness)), 1.0);
}
`;
