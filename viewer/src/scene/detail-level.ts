/** Walls and cell layers of the cave at one level of detail, for any tick of the run. */

import { Group, Vector3, type WebGLRenderer } from "three";
import { TICK_S, type Belief, type RunUpdate, type Run } from "../data/run.ts";
import { CellLayer, type CellLayerStyle } from "./cell-layer.ts";
import { agentRgb } from "./colours.ts";
import { QuadBuffers } from "./faces.ts";
import type { SharedUniforms } from "./glsl.ts";
import { computeOcclusion } from "./ambient-occlusion.ts";
import { BlockTimes, type BlockModel } from "./block-model.ts";
import type { CellTimes } from "../data/cell-times.ts";
import type { View } from "./view.ts";
import { edgeMaxOf, occlusionUniforms, TimesVolume, type OcclusionUniforms } from "./volumes.ts";
import { Walls } from "./walls.ts";

/** Maximum number of texels of the ambient occlusion. */
const OCCLUSION_TEXELS_MAX = 2 ** 23;

/** The belief of an agent as the wall shaders read it. */
interface Known {
  readonly belief: Belief;
  readonly times: BlockTimes;
  readonly volume: TimesVolume;
  /** Revision of the belief that `times` reflects. */
  revision: number;
}

/** Completeness of a frame. */
export interface Progress {
  /** Number of chunks built for it. */
  readonly built: number;
  /** Whether nothing is missing. */
  readonly isComplete: boolean;
}

export class DetailLevel {
  readonly group = new Group();
  readonly #walls: Walls;
  readonly #unexplored: CellLayer;
  readonly #seen: BlockTimes;
  /** Created when it is first shown. */
  #covered: { readonly times: BlockTimes; readonly layer: CellLayer } | null = null;
  /** Cells that a body reaches, of a map without a run. */
  #reach: CellLayer | null = null;
  readonly #buffers: QuadBuffers;
  readonly #occlusion: OcclusionUniforms;
  readonly #times: TimesVolume;
  #known: Known | null = null;

  constructor(
    readonly run: Run,
    readonly model: BlockModel,
    readonly common: SharedUniforms,
    gl: WebGL2RenderingContext,
  ) {
    this.#buffers = new QuadBuffers(gl);
    const limits = { blocksMax: OCCLUSION_TEXELS_MAX, edgeMax: edgeMaxOf(gl) };
    this.#occlusion = occlusionUniforms(computeOcclusion(model.walls, model.size, limits));
    this.#seen = new BlockTimes(model, run.firstSeenTick);
    this.#times = new TimesVolume(this.#seen.times, model.size);
    this.#walls = new Walls(model, this.#buffers, common, this.#times, this.#occlusion);
    this.#unexplored = this.#layer(this.#seen, UNEXPLORED);
    this.group.add(this.#walls.group);
    this.group.scale.setScalar(model.cellM);
  }

  #layer({ times }: BlockTimes, kind: Omit<CellLayerStyle, "counts">): CellLayer {
    const { walls, size } = this.model;
    const counts = (cell: number): boolean => walls[cell] === 0;
    const layer = new CellLayer(
      size,
      times,
      { ...kind, counts },
      this.#buffers,
      this.common,
      this.#occlusion,
    );
    this.group.add(layer.group);
    return layer;
  }

  /** The layer of the covered cells; null if it was never shown. */
  #coveredLayer(isShown: boolean): CellLayer | null {
    if (isShown && this.#covered === null) {
      const times = new BlockTimes(this.model, this.run.coveredTick);
      this.#covered = { times, layer: this.#layer(times, COVERED) };
    }
    return this.#covered?.layer ?? null;
  }

  markChanged(update: RunUpdate): void {
    const seen = this.#seen.markChanged(update.cells);
    this.#times.markChanged(seen);
    this.#unexplored.markChanged(seen);
    this.#covered?.layer.markChanged(this.#covered.times.markChanged(update.cells));
  }

  /** Sets the belief that the walls are compared with, or null. */
  setBelief(belief: Belief | null): void {
    this.#known?.volume.dispose();
    this.#known = null;
    if (belief === null) return;
    const times = new BlockTimes(this.model, belief.knownTick);
    const volume = new TimesVolume(times.times, this.model.size);
    this.#known = { belief, times, volume, revision: belief.revision };
  }

  /** Shows the cells that have a time as those that a body reaches; null: none. */
  setReach(cells: CellTimes | null): void {
    if (this.#reach !== null) {
      this.group.remove(this.#reach.group);
      this.#reach.dispose();
    }
    this.#reach = cells && this.#layer(new BlockTimes(this.model, cells), REACH);
  }

  /** Builds missing parts for a tick within the time budget. */
  make(tick: number, { layers }: View, budgetMs: number): Progress {
    const endMs = performance.now() + budgetMs;
    const hasTime = (): boolean => performance.now() < endMs;
    let built = 0;
    while (this.#walls.missing > 0 && hasTime()) {
      this.#walls.buildNext();
      built++;
    }
    let isComplete = this.hasWalls;
    for (const [layer, isShown] of [
      [this.#unexplored, layers.unexplored],
      [this.#coveredLayer(layers.covered), layers.covered],
      [this.#reach, true],
    ] as const) {
      if (layer === null) continue;
      layer.group.visible = isShown;
      if (!isShown) continue;
      const done = layer.show(tick, hasTime);
      built += done.built;
      isComplete &&= done.isComplete;
    }
    return { built, isComplete };
  }

  /** Whether all walls are built. */
  get hasWalls(): boolean {
    return this.#walls.missing === 0;
  }

  /** Prepares a frame. `isCut`: some part is cut away. */
  show(renderer: WebGLRenderer, view: View, isCut: boolean): void {
    this.#times.upload(renderer);
    const eye = this.common.eye.value.clone().divideScalar(this.model.cellM);
    this.#showWalls(renderer, view, eye, isCut);
    for (const layer of [this.#unexplored, this.#covered?.layer, this.#reach])
      layer?.selectFacing(eye, isCut);
  }

  dispose(): void {
    this.#walls.dispose();
    this.#unexplored.dispose();
    this.#covered?.layer.dispose();
    this.#reach?.dispose();
    this.#times.dispose();
    this.#occlusion.occlusion.value.dispose();
    this.#known?.volume.dispose();
  }

  #showWalls(renderer: WebGLRenderer, view: View, eye: Vector3, isCut: boolean): void {
    const known = view.layers.belief ? this.#known : null;
    if (known !== null) {
      if (known.revision !== known.belief.revision) {
        known.revision = known.belief.revision;
        known.times.markAllChanged();
        known.volume.markAllChanged();
      }
      known.volume.upload(renderer);
    }
    const paint = known === null ? null : agentRgb(known.belief.agent).map((share) => share * share * 0.9);
    const look = {
      isVisible: view.layers.walls,
      opacity: view.wallOpacity,
      isHeat: view.layers.heat,
      heatTicks: this.run.endS / TICK_S,
      known:
        known === null || paint === null ? null : { volume: known.volume, colour: new Vector3(...paint) },
    };
    this.#walls.show(look, eye, isCut);
    const axis = "xyz".indexOf(view.cut.axis);
    const { terrain, step } = this.model;
    const positionCells = (terrain.size[axis]! / step) * view.cut.share;
    this.#walls.cutAt(view.cut.share < 1 ? { axis, positionCells } : null);
  }
}

const UNEXPLORED = {
  isBefore: true,
  colour: [1, 0.25, 0.2],
  alphas: [0.17, 0.5],
  renderOrder: 5,
} as const;

const REACH = {
  isBefore: false,
  colour: [0.45, 0.95, 0.5],
  alphas: [0.22, 0.4],
  renderOrder: 4,
} as const;

const COVERED = {
  isBefore: false,
  colour: [0.25, 0.85, 0.95],
  alphas: [0.3, 0.45],
  renderOrder: 3,
} as const;
