/**
 * The cave of a run in two levels of detail, and the bounding box around it.
 *
 * Full detail draws single cells (or, if the map is too large, blocks of cells); coarse detail
 * draws larger blocks, a fraction of the faces, for frames that must be quick. Each level is built
 * when it is first needed.
 */

import { Group, Vector3, type WebGLRenderer } from "three";
import type { Belief, RunUpdate, Run, Terrain, Vec3 } from "../data/run.ts";
import type { CellSet } from "../data/cell-set.ts";
import { CellTimes, FLAT_CELLS_MAX } from "../data/cell-times.ts";
import { DetailLevel, type Progress } from "./detail-level.ts";
import type { SharedUniforms } from "./glsl.ts";
import { blockModelOf, type BlockModel } from "./block-model.ts";
import { Segments, type Segment } from "./ribbons.ts";
import type { View } from "./view.ts";
import { edgeMaxOf } from "./volumes.ts";

/** Maps with more cells are drawn in blocks: 256 along each axis. */
const BLOCKS_MAX = FLAT_CELLS_MAX;
/** Likewise in coarse detail: 64 along each axis. */
const COARSE_BLOCKS_MAX = 2 ** 18;

export class Cave {
  readonly root = new Group();
  /** Limitations in showing this map, for people. */
  readonly notices: readonly string[];
  /** Centre and extent of the free space, metres. */
  readonly middle: Vec3;
  readonly extentM: Vec3;
  readonly #full: BlockModel;
  /** Never built where everything is drawn in full detail. */
  #coarse: BlockModel | null = null;
  readonly #details = new Map<BlockModel, DetailLevel>();
  readonly #frame: Segments;
  #belief: Belief | null = null;
  #reach: CellTimes | null = null;
  #hasForeground = false;

  constructor(
    readonly run: Run,
    /** The map, at some time of the run. */
    readonly terrain: Terrain,
    readonly common: SharedUniforms,
    readonly gl: WebGL2RenderingContext,
  ) {
    this.#full = blockModelOf(terrain, BLOCKS_MAX, edgeMaxOf(gl));
    const { step } = this.#full;
    this.notices =
      step === 1 ? [] : [`The map is large: it is drawn in blocks of ${step} x ${step} x ${step} cells.`];
    const { cellM } = terrain;
    const [low, high] = boundsOf(terrain.walls, terrain.size);
    this.middle = low.map((value, axis) => ((value + high[axis]!) / 2) * cellM) as Vec3;
    this.extentM = low.map((value, axis) => (high[axis]! - value) * cellM) as Vec3;
    this.#frame = new Segments(common, 0, 3);
    this.#frame.show(
      frameOf(low.map((value) => value * cellM) as Vec3, high.map((value) => value * cellM) as Vec3),
    );
    this.root.add(...this.#frame.meshes);
  }

  markChanged(update: RunUpdate): void {
    for (const detail of this.#details.values()) detail.markChanged(update);
  }

  /** Sets the belief that the walls are compared with, or null. */
  setBelief(belief: Belief | null): void {
    this.#belief = belief;
    for (const detail of this.#details.values()) detail.setBelief(belief);
  }

  /** Shows cells that a body reaches, or null. */
  setReach(cells: CellSet | null): void {
    this.#reach = cells && new CellTimes(cells.length);
    for (let cell = 0; cells !== null && cell < cells.length; cell++)
      if (cells.has(cell)) this.#reach!.set(cell, 0);
    for (const detail of this.#details.values()) detail.setReach(this.#reach);
  }

  /**
   * Builds missing parts of the full-detail frame within the time budget. Returns whether nothing
   * is missing.
   */
  prepare(tick: number, view: View, budgetMs: number): boolean {
    return this.#detail(this.#full).make(tick, view, budgetMs).isComplete;
  }

  /**
   * Prepares the frame of a tick within the time budget. A coarse cave stands in until the full one
   * has all its walls.
   */
  show(
    renderer: WebGLRenderer,
    tick: number,
    view: View,
    { budgetMs, isCoarse }: { readonly budgetMs: number; readonly isCoarse: boolean },
  ): Progress {
    let shown = this.#detail(isCoarse ? this.#coarseModel() : this.#full);
    let { built, isComplete } = shown.make(tick, view, budgetMs);
    const standIn = this.#coarse === null ? undefined : this.#details.get(this.#coarse);
    if (!shown.hasWalls && standIn !== undefined) {
      isComplete = false;
      built += standIn.make(tick, view, budgetMs).built;
      shown = standIn;
    }
    for (const detail of this.#details.values()) detail.group.visible = detail === shown;
    this.#setCut(view);
    shown.show(renderer, view, view.cut.share < 1 || this.#hasForeground);
    return { built, isComplete };
  }

  /**
   * Cuts away the rock between the camera and a position that it follows, metres; null: nothing.
   */
  setForegroundCut(eye: Vec3, position: Vec3 | null): void {
    const { value } = this.common.foreground;
    const share = position === null ? 1 : this.#freeShare(position, eye);
    this.#hasForeground = share < 1;
    value.set(0, 0, 0, -1);
    if (position === null || share === 1) return;
    const towards = new Vector3(...eye).sub(new Vector3(...position));
    const lengthM = towards.length();
    towards.divideScalar(lengthM);
    value.set(towards.x, towards.y, towards.z, -towards.dot(new Vector3(...position)) - share * lengthM);
  }

  /** Share of the line between two positions that is free, from its start; 1: all of it. */
  #freeShare(from: Vec3, to: Vec3): number {
    const { size, cellM, walls } = this.terrain;
    const line = to.map((value, axis) => (value - from[axis]!) / cellM);
    const steps = Math.ceil(Math.hypot(...line) * SIGHT_STEPS_PER_CELL);
    for (let step = 1; step <= steps; step++) {
      const cell = line.map((part, axis) => Math.floor(from[axis]! / cellM + (part * step) / steps));
      const isInside = cell.every((value, axis) => value >= 0 && value < size[axis]!);
      if (!isInside || walls.has((cell[2]! * size[1] + cell[1]!) * size[0] + cell[0]!))
        return (step - 1) / steps;
    }
    return 1;
  }

  /** Builds everything again, because the GPU has lost what it alone had. */
  rebuild(): void {
    this.#disposeDetails();
    this.#details.clear();
  }

  dispose(): void {
    this.#disposeDetails();
    this.#frame.dispose();
  }

  #disposeDetails(): void {
    for (const detail of this.#details.values()) {
      this.root.remove(detail.group);
      detail.dispose();
    }
  }

  #coarseModel(): BlockModel {
    if (this.#coarse === null) {
      const coarse = blockModelOf(this.terrain, COARSE_BLOCKS_MAX, edgeMaxOf(this.gl));
      this.#coarse = coarse.step === this.#full.step ? this.#full : coarse;
    }
    return this.#coarse;
  }

  #detail(model: BlockModel): DetailLevel {
    let detail = this.#details.get(model);
    if (detail === undefined) {
      detail = new DetailLevel(this.run, model, this.common, this.gl);
      detail.setBelief(this.#belief);
      detail.setReach(this.#reach);
      this.#details.set(model, detail);
      this.root.add(detail.group);
    }
    return detail;
  }

  #setCut({ cut }: View): void {
    const axis = "xyz".indexOf(cut.axis);
    const { size, cellM } = this.terrain;
    this.common.cut.value.set(0, 0, 0, -1);
    if (cut.share < 1)
      this.common.cut.value.setComponent(axis, 1).setW((CUT_SLACK - size[axis]! * cut.share) * cellM);
  }
}

/** Sampling of the line of sight. */
const SIGHT_STEPS_PER_CELL = 8;

/** Offset of the cut plane, cells: faces in the plane belong to the part that is cut away. */
const CUT_SLACK = 0.002;

/** Bounding box of all free cells, in cells; the whole map if there are none. */
function boundsOf(walls: CellSet, size: Vec3): [Vec3, Vec3] {
  const low: Vec3 = [...size];
  const high: Vec3 = [0, 0, 0];
  let cell = 0;
  for (let z = 0; z < size[2]; z++) {
    for (let y = 0; y < size[1]; y++) {
      for (let x = 0; x < size[0]; x++, cell++) {
        if (walls.has(cell)) continue;
        if (x < low[0]) low[0] = x;
        if (y < low[1]) low[1] = y;
        if (z < low[2]) low[2] = z;
        if (x >= high[0]) high[0] = x + 1;
        if (y >= high[1]) high[1] = y + 1;
        if (z >= high[2]) high[2] = z + 1;
      }
    }
  }
  return high[0] === 0 ? [[0, 0, 0], [...size]] : [low, high];
}

/** The twelve edges of a box, faint. */
function frameOf(low: Vec3, high: Vec3): Segment[] {
  const corner = (bits: number): Vec3 =>
    [0, 1, 2].map((axis) => ((bits >> axis) & 1 ? high : low)[axis]!) as Vec3;
  const segments: Segment[] = [];
  for (let axis = 0; axis < 3; axis++) {
    for (let bits = 0; bits < 8; bits++) {
      if ((bits >> axis) & 1) continue;
      segments.push({
        from: corner(bits),
        to: corner(bits | (1 << axis)),
        colour: [0.55, 0.65, 0.8],
        alpha: 0.16,
        widthPx: 1,
        dashM: 0,
      });
    }
  }
  return segments;
}
