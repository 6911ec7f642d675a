/**
 * The cave of a run: walls, what nobody has seen, where bodies have been, and the frame around it all. Shows any moment of the run.
 */

import { Group, Vector3, type WebGLRenderer } from "three";
import { TICK_S, type Belief, type News, type Run, type Vec3 } from "../data/run.ts";
import { CellsLayer, type CellsKind } from "./cells.ts";
import { agentRgb } from "./colours.ts";
import { QuadIndex } from "./faces.ts";
import type { Common } from "./glsl.ts";
import { hollowsOf } from "./hollows.ts";
import { BlockTimes, modelOf, type Model } from "./model.ts";
import { Pieces, type Piece } from "./ribbons.ts";
import type { View } from "./view.ts";
import { TimesVolume } from "./volumes.ts";
import { Walls } from "./walls.ts";

/** Most texels of the light of hollows. */
const HOLLOWS_MAX = 2 ** 23;
/** Maps with more cells are drawn in blocks of them: 256 along each axis. */
const BLOCKS_MAX = 2 ** 24;

/** What an agent knows, as the walls take it. */
interface Known {
  readonly belief: Belief;
  readonly times: BlockTimes;
  readonly volume: TimesVolume;
  /** Of the belief, when it was taken over. */
  revision: number;
}

export class Cave {
  readonly root = new Group();
  /** What cannot be shown of this map, for people. */
  readonly notices: readonly string[];
  /** The middle of what is open, and how far it reaches along each axis; metres. */
  readonly middle: Vec3;
  readonly extentM: Vec3;
  readonly #walls: Walls;
  readonly #unexplored: CellsLayer;
  readonly #covered: CellsLayer;
  readonly #model: Model;
  readonly #seen: BlockTimes;
  readonly #visited: BlockTimes;
  readonly #times: TimesVolume;
  readonly #frame: Pieces;
  readonly #cells = new Group();
  #hasForeground = false;
  #known: Known | null = null;

  constructor(
    readonly run: Run,
    readonly common: Common,
    edgeMax: number,
  ) {
    const { terrain } = run;
    const model = modelOf(terrain, BLOCKS_MAX, edgeMax);
    this.#model = model;
    this.notices =
      model.step === 1
        ? []
        : [`The map is large: it is drawn in blocks of ${model.step} cells along each edge.`];
    const index = new QuadIndex();
    const hollows = hollowsOf(model.walls, model.size, HOLLOWS_MAX);
    this.#seen = new BlockTimes(model, run.firstSeenTick);
    this.#visited = new BlockTimes(model, run.coveredTick);
    this.#times = new TimesVolume(this.#seen.times, model.size);
    this.#walls = new Walls(model, index, common, this.#times, hollows);
    const layer = ({ times }: BlockTimes, kind: Omit<CellsKind, "counts">): CellsLayer => {
      const counts = (cell: number): boolean => model.walls[cell] === 0;
      return new CellsLayer(model.size, times, { ...kind, counts }, index, common, hollows);
    };
    this.#unexplored = layer(this.#seen, UNEXPLORED);
    this.#covered = layer(this.#visited, COVERED);
    this.#cells.add(this.#walls.group, this.#unexplored.group, this.#covered.group);
    this.#cells.scale.setScalar(model.cellM);
    const { cellM } = terrain;
    const [low, high] = boundsOf(terrain.walls, terrain.size);
    this.middle = low.map((value, axis) => ((value + high[axis]!) / 2) * cellM) as Vec3;
    this.extentM = low.map((value, axis) => (high[axis]! - value) * cellM) as Vec3;
    this.#frame = new Pieces(common, 0, 3);
    this.#frame.show(
      frameOf(low.map((value) => value * cellM) as Vec3, high.map((value) => value * cellM) as Vec3),
    );
    this.root.add(this.#cells, ...this.#frame.meshes);
  }

  learn(news: News): void {
    const seen = this.#seen.learn(news.cells);
    this.#times.learn(seen);
    this.#unexplored.learn(seen);
    this.#covered.learn(this.#visited.learn(news.cells));
  }

  /** What the walls are to be compared with, or null. */
  setBelief(belief: Belief | null): void {
    this.#known?.volume.dispose();
    this.#known = null;
    if (belief === null) return;
    const times = new BlockTimes(this.#model, belief.knownTick);
    const volume = new TimesVolume(times.times, this.#model.size);
    this.#known = { belief, times, volume, revision: belief.revision };
  }

  /** Makes the picture of a moment as far as the budget goes. Returns how many chunks were made, and whether nothing is missing. */
  show(
    renderer: WebGLRenderer,
    tick: number,
    view: View,
    budgetMs: number,
  ): { readonly made: number; readonly isRight: boolean } {
    const { layers } = view;
    const endMs = performance.now() + budgetMs;
    const mayGoOn = (): boolean => performance.now() < endMs;
    let made = 0;
    while (this.#walls.missing > 0 && mayGoOn()) {
      this.#walls.makeNext();
      made++;
    }
    let isRight = this.#walls.missing === 0;
    for (const [layer, isShown] of [
      [this.#unexplored, layers.unexplored],
      [this.#covered, layers.covered],
    ] as const) {
      layer.group.visible = isShown;
      if (!isShown) continue;
      const done = layer.show(tick, mayGoOn);
      made += done.made;
      isRight &&= done.isRight;
    }
    this.#times.send(renderer);
    const eye = this.common.eye.value.clone().divideScalar(this.#model.cellM);
    this.#showWalls(renderer, view, eye);
    this.#showCut(view, eye);
    return { made, isRight };
  }

  /** Leaves out what stands between the eye and the rock that is nearest to a place it looks at, or, with null, nothing; metres. */
  clearSight(eye: Vec3, place: Vec3 | null): void {
    const { value } = this.common.foreground;
    const share = place === null ? 1 : this.#freeShare(place, eye);
    this.#hasForeground = share < 1;
    value.set(0, 0, 0, -1);
    if (place === null || share === 1) return;
    const towards = new Vector3(...eye).sub(new Vector3(...place));
    const lengthM = towards.length();
    towards.divideScalar(lengthM);
    value.set(towards.x, towards.y, towards.z, -towards.dot(new Vector3(...place)) - share * lengthM);
  }

  /** How far one gets from a place towards another one before there is rock, as a share of the way; 1: all the way. */
  #freeShare(from: Vec3, to: Vec3): number {
    const { size, cellM, walls } = this.run.terrain;
    const way = to.map((value, axis) => (value - from[axis]!) / cellM);
    const steps = Math.ceil(Math.hypot(...way) * SIGHT_STEPS_PER_CELL);
    for (let step = 1; step <= steps; step++) {
      const cell = way.map((part, axis) => Math.floor(from[axis]! / cellM + (part * step) / steps));
      const isInside = cell.every((value, axis) => value >= 0 && value < size[axis]!);
      if (!isInside || walls[(cell[2]! * size[1] + cell[1]!) * size[0] + cell[0]!] !== 0)
        return (step - 1) / steps;
    }
    return 1;
  }

  dispose(): void {
    this.#walls.dispose();
    this.#unexplored.dispose();
    this.#covered.dispose();
    this.#times.dispose();
    this.#known?.volume.dispose();
    this.#frame.dispose();
  }

  #showWalls(renderer: WebGLRenderer, view: View, eye: Vector3): void {
    const known = view.layers.belief ? this.#known : null;
    if (known !== null) {
      if (known.revision !== known.belief.revision) {
        known.revision = known.belief.revision;
        known.times.learnAll();
        known.volume.learnAll();
      }
      known.volume.send(renderer);
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
    this.#walls.show(look, eye, view.cut.share < 1 || this.#hasForeground);
  }

  #showCut(view: View, eye: Vector3): void {
    const axis = "xyz".indexOf(view.cut.axis);
    const { terrain, cellM, step } = this.#model;
    const placeCells = (terrain.size[axis]! / step) * view.cut.share;
    const isCut = view.cut.share < 1;
    const isPierced = isCut || this.#hasForeground;
    this.common.cut.value.set(0, 0, 0, -1);
    if (isCut) this.common.cut.value.setComponent(axis, 1).setW((CUT_SLACK - placeCells) * cellM);
    for (const layer of [this.#unexplored, this.#covered]) layer.aim(eye, isPierced);
    this.#walls.cutAt(isCut ? { axis, placeCells } : null);
  }
}

/** How finely a line of sight is followed. */
const SIGHT_STEPS_PER_CELL = 8;

/** Faces that lie in the plane of a cut go with what is beyond it; cells. */
const CUT_SLACK = 0.002;

const UNEXPLORED = {
  isBefore: true,
  colour: [1, 0.25, 0.2],
  alphas: [0.17, 0.5],
  renderOrder: 5,
} as const;

const COVERED = {
  isBefore: false,
  colour: [0.25, 0.85, 0.95],
  alphas: [0.3, 0.45],
  renderOrder: 3,
} as const;

/** The lowest and the highest corner of the box around all free cells, in cells; the whole map if there are none. */
function boundsOf(walls: Uint8Array, size: Vec3): [Vec3, Vec3] {
  const low: Vec3 = [...size];
  const high: Vec3 = [0, 0, 0];
  let cell = 0;
  for (let z = 0; z < size[2]; z++) {
    for (let y = 0; y < size[1]; y++) {
      for (let x = 0; x < size[0]; x++, cell++) {
        if (walls[cell] !== 0) continue;
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
function frameOf(low: Vec3, high: Vec3): Piece[] {
  const corner = (bits: number): Vec3 =>
    [0, 1, 2].map((axis) => ((bits >> axis) & 1 ? high : low)[axis]!) as Vec3;
  const pieces: Piece[] = [];
  for (let axis = 0; axis < 3; axis++) {
    for (let bits = 0; bits < 8; bits++) {
      if ((bits >> axis) & 1) continue;
      pieces.push({
        from: corner(bits),
        to: corner(bits | (1 << axis)),
        colour: [0.55, 0.65, 0.8],
        alpha: 0.16,
        widthPx: 1,
        dashM: 0,
      });
    }
  }
  return pieces;
}
