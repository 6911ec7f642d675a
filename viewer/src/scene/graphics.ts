/** The graphics context of a canvas, and what the browser reveals of it. */

/** A canvas with a WebGL 2 context. */
export interface Graphics {
  readonly canvas: HTMLCanvasElement;
  readonly context: WebGL2RenderingContext;
  /** Whether frames are rendered by the CPU, as far as the browser reveals it. */
  readonly isSoftware: boolean;
}

/**
 * Creates a canvas with a context; null without WebGL 2. Software renders without antialiasing
 * unless `antialias` says so, because it is paid for by the pixel.
 */
export function openGraphics(antialias: boolean): Graphics | null {
  const graphics = contextOf(document.createElement("canvas"), antialias);
  if (graphics === null || antialias || graphics.isSoftware) return graphics;
  // Only a context shows what renders it. A second one costs little on a GPU, and much in software.
  graphics.context.getExtension("WEBGL_lose_context")?.loseContext();
  return contextOf(document.createElement("canvas"), true);
}

function contextOf(canvas: HTMLCanvasElement, antialias: boolean): Graphics | null {
  // The attributes of three.js.
  const context = canvas.getContext("webgl2", {
    alpha: true,
    depth: true,
    stencil: false,
    antialias,
    premultipliedAlpha: true,
    preserveDrawingBuffer: false,
    powerPreference: "high-performance",
  });
  return context && { canvas, context, isSoftware: isSoftware(context) };
}

function isSoftware(gl: WebGL2RenderingContext): boolean {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info === null ? gl.RENDERER : info.UNMASKED_RENDERER_WEBGL));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
