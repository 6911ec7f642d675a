/** Overlay with rendering statistics: frame rate, cost of a frame, triangles. */
import type { Scene } from "../scene/scene.ts";
import { el, setText } from "./dom.ts";
import { count } from "./format.ts";

const WINDOW_S = 1;

export class RenderStats {
  readonly root = el("div", { class: "render-stats float", testid: "render-stats", hidden: true });
  #drawnS: number[] = [];

  frameDrawn(wallS: number): void {
    this.#drawnS.push(wallS);
    while (this.#drawnS[0]! < wallS - WINDOW_S) this.#drawnS.shift();
  }

  update(wallS: number, scene: Scene | null, costMs: number, pixelRatio: number): void {
    if (this.root.hidden) return;
    const frames = this.#drawnS.filter((time) => time >= wallS - WINDOW_S).length;
    const parts = [
      `${frames} frames/s`,
      `${costMs.toFixed(0)} ms`,
      scene ? `${count(scene.stats.triangles)} triangles` : "",
      scene ? `${count(scene.stats.chunksRebuilt)} chunks rebuilt` : "",
      `pixel ratio ${Number(pixelRatio.toFixed(2))}`,
    ];
    setText(this.root, parts.filter(Boolean).join("\n"));
  }
}
