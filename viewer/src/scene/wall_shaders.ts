/** Shaders of the walls; see `walls.ts` for what they show. */

import { FRAGMENT_HEAD, NORMALS, VERTEX_HEAD } from "./glsl.ts";

export const WALL_VERTEX = /* glsl */ `${VERTEX_HEAD}${NORMALS}
in vec4 corner;
out vec3 placeCells;
out vec3 placeM;
flat out int facing;

void main() {
  facing = int(corner.w);
  // Rectangles of different lengths meet along edges; half a pixel more on each side leaves no gaps between them.
  int axis = facing >> 1;
  int turn = gl_VertexID & 3;
  if (((facing & 1) == 1) != (axis == 1)) turn = 3 - turn;
  vec2 outward = vec2(turn == 1 || turn == 2 ? 1.0 : -1.0, turn >= 2 ? 1.0 : -1.0);
  vec3 across = axis == 0 ? vec3(0.0, outward) : axis == 1 ? vec3(outward.x, 0.0, outward.y) : vec3(outward, 0.0);
  vec4 place = modelMatrix * vec4(corner.xyz, 1.0);
  place.xyz += across * (0.5 * pixelM * distance(eye, place.xyz));
  placeCells = corner.xyz;
  placeM = place.xyz;
  gl_Position = projectionMatrix * viewMatrix * place;
}
`;

const WALL_COMMON = /* glsl */ `${FRAGMENT_HEAD}${NORMALS}
in vec3 placeCells;
in vec3 placeM;
flat in int facing;
uniform usampler3D times;
uniform int shift;
uniform usampler3D known;
uniform int knownShift;
uniform vec3 knownColour;
uniform bool hasKnown;
uniform bool isHeat;
uniform float heatScale;
uniform sampler2D heat;
uniform sampler3D hollows;
uniform vec3 hollowsScale;
uniform vec3 lastCell;
uniform float opacity;

const vec3 STONE = vec3(0.60, 0.47, 0.335);
const vec3 STONE_HIGH = vec3(0.66, 0.57, 0.455);
const vec3 NIGHT = vec3(0.034, 0.050, 0.092);

// What the wall before a free cell looks like without light.
vec3 surface(ivec3 cell) {
  uint seen = texelFetch(times, cell >> shift, 0).r;
  if (seen > nowTick) return NIGHT;
  if (isHeat) return square(texture(heat, vec2(sqrt(float(seen) * heatScale), 0.5)).rgb) * 0.9;
  vec3 stone = mix(STONE, STONE_HIGH, 0.5 + 0.5 * sin(placeCells.z * 0.45));
  // A little of each cell's own.
  uint h = uint(cell.x) * 73856093u ^ uint(cell.y) * 19349663u ^ uint(cell.z) * 83492791u;
  h = (h ^ (h >> 13)) * 1274126177u;
  stone *= 0.94 + 0.12 * float((h >> 16) & 255u) / 255.0;
  if (hasKnown) {
    uint told = texelFetch(known, cell >> knownShift, 0).r;
    stone = told > nowTick ? stone * 0.16 + NIGHT * 0.5 : mix(stone, knownColour, 0.42);
  }
  // What was seen just now shines for a moment.
  float age = float(nowTick - seen) * 0.02;
  return stone * (1.0 + 0.5 * exp(-age * 0.6));
}
`;

export const WALL_FRAGMENT = /* glsl */ `${WALL_COMMON}
void main() {
  if (isCut(placeM)) discard;
  vec3 flatNormal = NORMALS[facing];
  ivec3 cell = ivec3(clamp(floor(placeCells + flatNormal * 0.5), vec3(0.0), lastCell));
  vec4 hollow = texture(hollows, (placeCells + flatNormal * 0.7) * hollowsScale);
  vec3 smoothNormal = hollow.rgb * 2.0 - 1.0;
  vec3 n = normalize(flatNormal * 0.75 + smoothNormal * 0.8);
  float open = hollow.a;
  float shade = smoothstep(0.12, 0.62, open);
  float key = max(dot(n, light) * 0.75 + 0.25, 0.0);
  float sky = 0.5 + 0.5 * n.z;
  vec3 lit = vec3(0.16, 0.19, 0.26) * mix(0.4, 1.0, sky) + vec3(1.08, 0.98, 0.86) * key * key;
  vec3 c = surface(cell) * lit * mix(0.25, 1.15, shade);
  float distanceM = distance(eye, placeM);
  colour = vec4(shown(hazy(c, distanceM)), 1.0);
}
`;

export const WALL_SHELL_FRAGMENT = /* glsl */ `${WALL_COMMON}
void main() {
  if (isCut(placeM)) discard;
  vec3 flatNormal = NORMALS[facing];
  ivec3 cell = ivec3(clamp(floor(placeCells + flatNormal * 0.5), vec3(0.0), lastCell));
  vec3 n = normalize(flatNormal * 0.35 + (texture(hollows, (placeCells - flatNormal * 0.2) * hollowsScale).rgb * 2.0 - 1.0));
  // The rock's side of the face; a pane is clearest where one looks straight through.
  vec3 toEye = normalize(eye - placeM);
  float glance = 1.0 - abs(dot(n, toEye));
  float key = max(dot(-n, light), 0.0);
  vec3 c = surface(cell) * (vec3(0.24, 0.28, 0.36) + vec3(1.0, 0.94, 0.86) * key * key) + vec3(0.02, 0.03, 0.05) * glance;
  float alpha = mix(opacity * (0.25 + 1.9 * glance * glance), 1.0, opacity * opacity);
  colour = vec4(shown(hazy(c, distance(eye, placeM))), min(alpha, 1.0));
}
`;

export const RIM_FRAGMENT = /* glsl */ `${WALL_COMMON}
void main() {
  vec3 n = NORMALS[facing];
  float key = max(dot(n, light), 0.0);
  vec3 c = vec3(0.045, 0.055, 0.078) * (0.7 + 0.6 * key);
  colour = vec4(shown(hazy(c, distance(eye, placeM))), 1.0);
}
`;
