/**
 * Parts of shaders that several layers share, and the values that all of them read.
 *
 * Colours are mixed as squares of what is shown, which is close to how light adds up, and `shown` takes the root at the end.
 */

import { Vector2, Vector3, Vector4, type IUniform, type RawShaderMaterial } from "three";

/** Values that belong to the picture rather than to a layer; one set for a scene, which all materials hold. */
export interface SharedUniforms {
  readonly [name: string]: IUniform;
  /** Tick of the moment that is shown. */
  readonly nowTick: IUniform<number>;
  /** Towards the main light, unit, metres. */
  readonly light: IUniform<Vector3>;
  /** The eye, metres. */
  readonly eye: IUniform<Vector3>;
  /** Distance at which the haze begins, and one over the way on which it grows; metres. */
  readonly haze: IUniform<Vector2>;
  /** A place is cut off where the product with (x, y, z, 1) is above 0; metres. */
  readonly cut: IUniform<Vector4>;
  /** Likewise, for what stands between the eye and what it follows. */
  readonly foreground: IUniform<Vector4>;
  /** Picture's width and height in its own pixels. */
  readonly picture: IUniform<Vector2>;
  /** Metres that a pixel spans at a metre's distance. */
  readonly pixelM: IUniform<number>;
  /** Pixels of the picture for each CSS pixel. */
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
    picture: { value: new Vector2(1, 1) },
    pixelM: { value: 0.001 },
    pixelRatio: { value: 1 },
  };
}

/** Compiles a material with these definitions if it has not got them. */
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
uniform vec2 picture;
uniform float pixelM;
uniform float pixelRatio;
`;

export const VERTEX_HEAD = /* glsl */ `${HEAD}
uniform mat4 modelMatrix;
uniform mat4 viewMatrix;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
// How much of the haze lies before a place.
float hazinessAt(float distanceM) { return 0.72 * clamp((distanceM - haze.x) * haze.y, 0.0, 1.0); }
`;

/** What faces of cells need in both shaders: the normals by number of direction. */
export const NORMALS = /* glsl */ `
const vec3 NORMALS[6] = vec3[6](
  vec3(1, 0, 0), vec3(-1, 0, 0), vec3(0, 1, 0), vec3(0, -1, 0), vec3(0, 0, 1), vec3(0, 0, -1));
`;

export const FRAGMENT_HEAD = /* glsl */ `${HEAD}
out vec4 colour;
const vec3 HAZE = vec3(0.0026, 0.0042, 0.0078);
vec3 square(vec3 c) { return c * c; }
vec3 shown(vec3 c) { return sqrt(c); }
bool isCut(vec3 placeM) { return max(dot(cut, vec4(placeM, 1.0)), dot(foreground, vec4(placeM, 1.0))) > 0.0; }
`;
