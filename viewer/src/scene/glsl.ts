/**
 * Shared shader code, and the uniforms that all materials read.
 *
 * Colours are mixed as squares of sRGB, an approximation of linear light; `shown` takes the root at
 * the end.
 */

import { Vector2, Vector3, Vector4, type IUniform, type RawShaderMaterial } from "three";

/** Uniforms of the frame rather than of a layer; one set per scene, shared by all materials. */
export interface SharedUniforms {
  readonly [name: string]: IUniform;
  /** Tick of the frame. */
  readonly nowTick: IUniform<number>;
  /** Unit vector to the main light. */
  readonly light: IUniform<Vector3>;
  /** Camera position, metres. */
  readonly eye: IUniform<Vector3>;
  /**
   * Distance at which the haze begins, metres, and the reciprocal of the distance over which it
   * grows.
   */
  readonly haze: IUniform<Vector2>;
  /** Clip plane: positions are cut away where the product with (x, y, z, 1) is positive; metres. */
  readonly cut: IUniform<Vector4>;
  /** Likewise, for the rock between the camera and the agent that it follows. */
  readonly foreground: IUniform<Vector4>;
  /** Width and height of the frame buffer, pixels. */
  readonly frameSize: IUniform<Vector2>;
  /** Whether the background is white: 0 or 1. */
  readonly paper: IUniform<number>;
  /** Size of a pixel at a distance of one metre, metres. */
  readonly pixelM: IUniform<number>;
  /** Frame buffer pixels per CSS pixel. */
  readonly pixelRatio: IUniform<number>;
}

export function makeSharedUniforms(): SharedUniforms {
  return {
    nowTick: { value: 0 },
    light: { value: new Vector3(0, 0, 1) },
    eye: { value: new Vector3() },
    haze: { value: new Vector2(0, 0) },
    cut: { value: new Vector4(0, 0, 0, -1) },
    foreground: { value: new Vector4(0, 0, 0, -1) },
    frameSize: { value: new Vector2(1, 1) },
    paper: { value: 0 },
    pixelM: { value: 0.001 },
    pixelRatio: { value: 1 },
  };
}

/** Sets the defines of a material, which recompiles it if they have changed. */
export function setDefines(material: RawShaderMaterial, names: readonly string[]): void {
  if (Object.keys(material.defines ?? {}).join() === names.join()) return;
  material.defines = Object.fromEntries(names.map((name) => [name, 1]));
  material.needsUpdate = true;
}

export const HEAD = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler3D;
precision highp usampler3D;
uniform uint nowTick;
uniform vec3 light;
uniform vec3 eye;
uniform vec2 haze;
uniform vec4 cut;
uniform vec4 foreground;
uniform vec2 frameSize;
uniform float paper;
uniform float pixelM;
uniform float pixelRatio;
`;

export const VERTEX_HEAD = /* glsl */ `${HEAD}
uniform mat4 modelMatrix;
uniform mat4 viewMatrix;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
// Share of the haze in front of a position.
float hazinessAt(float distanceM) { return 0.72 * clamp((distanceM - haze.x) * haze.y, 0.0, 1.0); }
`;

/** Normals of cell faces by direction number. */
export const NORMALS = /* glsl */ `
const vec3 NORMALS[6] = vec3[6](
  vec3(1, 0, 0), vec3(-1, 0, 0), vec3(0, 1, 0), vec3(0, -1, 0), vec3(0, 0, 1), vec3(0, 0, -1));
`;

/** Direction from the middle of a rectangle to its corner, along the two axes across the face. */
export const CORNER_OUTWARD = /* glsl */ `
ivec2 cornerOutward(int facing) {
  int turn = gl_VertexID & 3;
  if (((facing & 1) == 1) != (facing >> 1 == 1)) turn = 3 - turn;
  return ivec2(turn == 1 || turn == 2 ? 1 : -1, turn >= 2 ? 1 : -1);
}
`;

/**
 * Reads a packed corner (`faces.ts`), with the ambient occlusion there. The origin of a mesh, in
 * cells, is in its matrix, beside the length of a cell.
 */
export const PACKED_CORNER = /* glsl */ `${CORNER_OUTWARD}
in uint corner;
uniform usampler3D occlusion;
uniform int occlusionStep;
int cornerFacing() { return int((corner >> 18) & 7u); }
ivec3 cornerCells() {
  return ivec3(round(modelMatrix[3].xyz / modelMatrix[0].x)) +
    ivec3(uvec3(corner, corner >> 6, corner >> 12) & 63u);
}
uvec4 occlusionTexel(ivec3 cells) {
  return texelFetch(occlusion, (cells + (occlusionStep >> 1)) / occlusionStep, 0);
}
// Direction out of the rock, and openness.
vec4 occlusionOf(uvec4 texel) { return vec4(vec3(texel.rgb) * (2.0 / 255.0) - 1.0, float(texel.a) / 255.0); }
// The sum of the texels at the other three corners of the rectangle.
uvec4 otherTexels(ivec3 cells, int facing) {
  ivec2 inward = -cornerOutward(facing) * ivec2(uvec2(corner >> 21, corner >> 24) & 7u);
  int axis = facing >> 1;
  ivec3 u = axis == 0 ? ivec3(0, inward.x, 0) : ivec3(inward.x, 0, 0);
  ivec3 v = axis == 2 ? ivec3(0, inward.y, 0) : ivec3(0, 0, inward.y);
  return occlusionTexel(cells + u) + occlusionTexel(cells + v) + occlusionTexel(cells + u + v);
}
`;

export const FRAGMENT_HEAD = /* glsl */ `${HEAD}
out vec4 colour;
const vec3 NIGHT_HAZE = vec3(0.0026, 0.0042, 0.0078);
vec3 hazeColour() { return mix(NIGHT_HAZE, vec3(1.0), paper); }
vec3 square(vec3 c) { return c * c; }
vec3 shown(vec3 c) { return sqrt(c); }
bool isCut(vec3 positionM) { return max(dot(cut, vec4(positionM, 1.0)), dot(foreground, vec4(positionM, 1.0))) > 0.0; }
`;
