/**
 * The caves of a run: one for the map of each time, of which one is drawn.
 *
 * The camera keeps to the cave of the start. Others are made when their time is shown; few are
 * kept.
 */

import { Group } from "three";
import type { Belief, Run, RunUpdate, Terrain } from "../data/run.ts";
import { Cave } from "./cave.ts";
import type { SharedUniforms } from "./glsl.ts";

/** Caves that are kept beside that of the start. */
const KEPT_MAX = 2;

export class Caves {
  readonly root = new Group();
  readonly start: Cave;
  /** Those of other maps; the last one shown comes last. */
  readonly #others = new Map<Terrain, Cave>();
  #belief: Belief | null = null;

  constructor(
    readonly run: Run,
    readonly common: SharedUniforms,
    readonly gl: WebGL2RenderingContext,
  ) {
    this.start = new Cave(run, run.terrain, common, gl);
    this.root.add(this.start.root);
  }

  /** The cave at a time, which alone is drawn from now on. */
  at(timeS: number): Cave {
    const terrain = this.run.terrainAt(timeS);
    const cave = terrain === this.run.terrain ? this.start : this.#other(terrain);
    for (const other of this.#all()) other.root.visible = other === cave;
    return cave;
  }

  markChanged(update: RunUpdate): void {
    for (const cave of this.#all()) cave.markChanged(update);
  }

  /** Sets the belief that the walls are compared with, or null. */
  setBelief(belief: Belief | null): void {
    this.#belief = belief;
    for (const cave of this.#all()) cave.setBelief(belief);
  }

  /** Builds everything again, because the GPU has lost what it alone had. */
  rebuild(): void {
    for (const cave of this.#all()) cave.rebuild();
  }

  dispose(): void {
    for (const cave of this.#all()) cave.dispose();
  }

  #all(): Cave[] {
    return [this.start, ...this.#others.values()];
  }

  #other(terrain: Terrain): Cave {
    const cave = this.#others.get(terrain) ?? new Cave(this.run, terrain, this.common, this.gl);
    if (!this.#others.delete(terrain)) {
      cave.setBelief(this.#belief);
      this.root.add(cave.root);
    }
    this.#others.set(terrain, cave);
    const [oldest] = this.#others;
    if (this.#others.size > KEPT_MAX) {
      const [unused, gone] = oldest!;
      this.#others.delete(unused);
      this.root.remove(gone.root);
      gone.dispose();
    }
    return cave;
  }
}
