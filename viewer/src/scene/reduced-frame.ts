/**
 * A frame of fewer pixels than the canvas has, enlarged onto it: what is drawn afterwards, such as
 * labels, is as sharp as in a full frame.
 */

import {
  GLSL3,
  LinearFilter,
  Mesh,
  RawShaderMaterial,
  Scene as Graph,
  WebGLRenderTarget,
  type BufferGeometry,
  type Camera,
  type Vector2,
  type WebGLRenderer,
} from "three";
import { screenTriangle } from "./screen-triangle.ts";

const VERTEX = /* glsl */ `
in vec2 at;
out vec2 vAt;
void main() {
  vAt = at * 0.5 + 0.5;
  gl_Position = vec4(at, 0.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
precision mediump float;
in vec2 vAt;
uniform sampler2D frame;
out vec4 colour;
void main() { colour = texture(frame, vAt); }
`;

/** Samples for each pixel of an antialiased frame, as of the canvas. */
const SAMPLES = 4;

export class ReducedFrame {
  readonly #target: WebGLRenderTarget;
  readonly #enlarged: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly #graph = new Graph();

  constructor(antialias: boolean) {
    this.#target = new WebGLRenderTarget(1, 1, {
      magFilter: LinearFilter,
      minFilter: LinearFilter,
      samples: antialias ? SAMPLES : 0,
    });
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { frame: { value: this.#target.texture } },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      depthTest: false,
      depthWrite: false,
    });
    this.#enlarged = new Mesh(screenTriangle(), material);
    this.#enlarged.frustumCulled = false;
    this.#graph.add(this.#enlarged);
  }

  /** Draws a graph in a size in pixels, and fills the canvas with it. Returns its triangles. */
  render(renderer: WebGLRenderer, graph: Graph, camera: Camera, size: Vector2): number {
    this.#target.setSize(size.x, size.y);
    renderer.setRenderTarget(this.#target);
    renderer.render(graph, camera);
    const { triangles } = renderer.info.render;
    renderer.setRenderTarget(null);
    renderer.render(this.#graph, camera);
    return triangles;
  }

  dispose(): void {
    this.#target.dispose();
    this.#enlarged.geometry.dispose();
    this.#enlarged.material.dispose();
  }
}
