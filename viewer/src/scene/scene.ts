/**
 * Three-dimensional rendering of a run on a canvas.
 *
 * A frame depends only on the run, the time, the view options and the camera, and not on earlier
 * frames, once it is `settled`: other frames have a time budget, so their cell layers may lag
 * behind. The scene selects nothing on its own: it reports what lies at a position (`pick`).
 */

import { Scene as Graph, Vector2, Vector3, WebGLRenderer } from "three";
import type { CellSet } from "../data/cell-set.ts";
import { surfaceHit, type SurfaceHit } from "../data/surface-hit.ts";
import { TICK_S, type Belief, type Hits, type Run, type RunUpdate, type Vec3 } from "../data/run.ts";
import { Background } from "./background.ts";
import type { Cave } from "./cave.ts";
import { Caves } from "./caves.ts";
import { CameraRig, type CameraMove } from "./camera-rig.ts";
import { makeSharedUniforms, type SharedUniforms } from "./glsl.ts";
import { openGraphics } from "./graphics.ts";
import { HitPoints } from "./hits.ts";
import { MapMarks, type Marks } from "./map-marks.ts";
import { Obstacles } from "./obstacles.ts";
import { distanceToFit, FIELD_OF_VIEW_RAD, NAMED_VIEWS, type Orbit } from "./orbit.ts";
import { ReducedFrame } from "./reduced-frame.ts";
import { Team } from "./team.ts";
import { defaultView, type View } from "./view.ts";
import { GLASS_BELOW } from "./wall-shaders.ts";

export { DEFAULT_LAYERS, type Layers, type View } from "./view.ts";

/**
 * Time budget of a frame for building chunks: a share of the time since the last frame, so that
 * missing parts come soon on a slow machine too, between these bounds.
 */
const BUDGET_SHARE = 0.2;
const BUDGET_MS = [8, 60] as const;
/** A coarse cave has few chunks: most frames of another time are complete. */
const COARSE_BUDGET_MS = [100, 200] as const;

/** The cave is drawn in full detail where cells are larger on the screen than this; CSS pixels. */
const NEAR_CELL_PX = 12;

/** Effort spent on a frame. */
interface RenderEffort {
  /** For building chunks. */
  readonly budgetMs: number;
  /** Whether the cave is drawn in coarse detail. */
  readonly isCoarse: boolean;
  /** Whether the faint walls are omitted. */
  readonly skipsGlass: boolean;
}

/** No limits. */
const FULL_EFFORT: RenderEffort = { budgetMs: Infinity, isCoarse: false, skipsGlass: false };

const CAVE_YAW_RAD = (62 * Math.PI) / 180;
/** Distance of the camera from a selected agent, cells. */
const AGENT_DISTANCE_CELLS = 11;
const AGENT_PITCH_RAD = (24 * Math.PI) / 180;

/** The objects of a run. */
interface LoadedRun {
  readonly run: Run;
  readonly caves: Caves;
  readonly team: Team;
  readonly obstacles: Obstacles;
  readonly marks: MapMarks;
  readonly stopListening: () => void;
}

export class Scene {
  readonly view: View = defaultView();
  readonly canvas: HTMLCanvasElement;
  /**
   * Whether frames are rendered by the CPU, as far as the browser reveals it: then the cost is per
   * pixel.
   */
  readonly isSoftware: boolean;
  readonly #gl: WebGL2RenderingContext;
  readonly #renderer: WebGLRenderer;
  readonly #graph = new Graph();
  /** Labels, which are drawn last, in all pixels of the canvas. */
  readonly #labels = new Graph();
  readonly #common = makeSharedUniforms();
  /** Those of the labels, whose frame is the canvas. */
  readonly #labelCommon: SharedUniforms = {
    ...this.#common,
    frameSize: { value: new Vector2(1, 1) },
    pixelRatio: { value: 1 },
  };
  readonly #reduced: ReducedFrame;
  readonly #background: Background;
  readonly #hitPoints: HitPoints;
  readonly #cameraRig: CameraRig;
  #loaded: LoadedRun | null = null;
  #selected: number | null = null;
  #reach: CellSet | null = null;
  #size = { width: 1, height: 1 };
  #timeS = 0;
  #lastFrameMs = -Infinity;
  #isDirty = true;
  #isIncomplete = false;
  #followed: number | null = null;
  #following: Promise<void> = Promise.resolve();
  #hits: { readonly agent: number; readonly timeS: number; readonly hits: Hits | null } | null = null;
  #pendingHits: { readonly agent: number; readonly timeS: number; readonly answer: Promise<void> } | null =
    null;
  #stats = { triangles: 0, chunksRebuilt: 0, milliseconds: 0 };

  /**
   * Throws a readable error without WebGL 2. `isForPictures`: antialias in any case; otherwise
   * software rendering does not.
   */
  constructor({ isForPictures }: { readonly isForPictures: boolean } = { isForPictures: false }) {
    const graphics = openGraphics(isForPictures);
    if (graphics === null) {
      throw new Error(
        "This browser does not support WebGL 2, which rendering needs. Try another browser, or enable graphics " +
          "acceleration in its settings.",
      );
    }
    const { canvas, context } = graphics;
    this.canvas = canvas;
    this.#gl = context;
    this.isSoftware = graphics.isSoftware;
    this.#renderer = new WebGLRenderer({ canvas, context });
    // Checking shader errors would wait for their compilation.
    this.#renderer.debug.checkShaderErrors = import.meta.env.DEV;
    this.#reduced = new ReducedFrame(isForPictures || !graphics.isSoftware);
    this.#background = new Background(this.#common);
    this.#hitPoints = new HitPoints(this.#common);
    this.#graph.add(this.#background.mesh, this.#hitPoints.points);
    this.#cameraRig = new CameraRig(canvas);
    canvas.addEventListener("webglcontextrestored", this.#restore);
  }

  get selected(): number | null {
    return this.#selected;
  }

  /** Limitations in showing the run, for people. */
  get notices(): readonly string[] {
    return this.#loaded?.caves.start.notices ?? [];
  }

  get stats(): {
    readonly triangles: number;
    readonly chunksRebuilt: number;
    readonly milliseconds: number;
  } {
    return this.#stats;
  }

  /**
   * Whether nothing is shown and never was. The first frame waits for the GPU, which must not delay
   * the opening of a run.
   */
  get isBlank(): boolean {
    return this.#loaded === null && this.#lastFrameMs === -Infinity;
  }

  /**
   * Whether the next frame may differ from the last one at the same time: a flight, camera input,
   * or an update of the run.
   */
  get needsRedraw(): boolean {
    return this.#isDirty || this.#isIncomplete || this.#cameraRig.needsRedraw;
  }

  /** Shows another run, or none; the camera moves to the whole cave. */
  setRun(run: Run | null): void {
    this.#clear();
    if (run === null) return;
    const caves = new Caves(run, this.#common, this.#gl);
    const cave = caves.start;
    const team = new Team(run, this.#common, this.#labelCommon);
    const obstacles = new Obstacles(run, this.#common);
    const marks = new MapMarks(this.#common, caves.root);
    this.#graph.add(caves.root, team.root, obstacles.root);
    this.#labels.add(team.labels);
    const stopListening = run.onUpdate((update) => {
      caves.markChanged(update);
      this.#isDirty ||= this.#concerns(update);
    });
    this.#loaded = { run, caves, team, obstacles, marks, stopListening };
    const { cellM } = run.terrain;
    const reachM = Math.hypot(...cave.extentM) / 2;
    this.#cameraRig.setLimits([1.5 * cellM, reachM * 7], reachM);
    this.#cameraRig.goTo(this.#caveOrbit(cave), cave.middle, false);
    // Shaders compile while the chunks are built.
    for (const graph of [this.#graph, this.#labels]) this.#renderer.compile(graph, this.#cameraRig.camera);
  }

  /**
   * Selects an agent, flies to it (ignoring camera input meanwhile) and follows it; null: the whole
   * cave.
   */
  select(agent: number | null, options: { readonly fly: boolean } = { fly: true }): void {
    const loaded = this.#loaded;
    if (loaded === null || (agent !== null && !(agent >= 0 && agent < loaded.run.setup.agents))) return;
    this.#selected = agent;
    this.#isDirty = true;
    if (agent === null) {
      const cave = loaded.caves.start;
      this.#cameraRig.goTo(this.#caveOrbit(cave), cave.middle, options.fly);
      return;
    }
    const state = loaded.run.agentAt(agent, this.#timeS);
    const distanceM = AGENT_DISTANCE_CELLS * loaded.run.terrain.cellM;
    const orbit: Orbit = { centre: [0, 0, 0], yawRad: state.yawRad, pitchRad: AGENT_PITCH_RAD, distanceM };
    this.#cameraRig.goTo(orbit, state.position, options.fly);
  }

  /** The camera, at the end of a flight: relative to the middle of the map or to the selected agent. */
  get orbit(): Orbit {
    return this.#cameraRig.orbit;
  }

  /** Moves the camera around the middle of the map or the selected agent, at once. */
  setOrbit(orbit: Orbit): void {
    this.#cameraRig.setOrbit(orbit);
  }

  /** Shows the whole map in a view with a name, at once. */
  lookFrom(name: keyof typeof NAMED_VIEWS): void {
    const cave = this.#loaded?.caves.start;
    if (cave === undefined) return;
    const orbit = { ...this.#caveOrbit(cave), ...NAMED_VIEWS[name] };
    this.#cameraRig.goTo({ ...orbit, distanceM: this.#fitted(cave, orbit) }, cave.middle, false);
  }

  /** Moves the camera, unless it is in flight. */
  moveCamera(change: CameraMove): void {
    this.#cameraRig.move(change);
  }

  /** Size of a CSS pixel at the centre of the orbit, metres. */
  get pixelM(): number {
    return pixelM(this.#size.height) * this.#cameraRig.distanceM;
  }

  /** The box of the free space, metres; null: there is no run. */
  get box(): { readonly low: Vec3; readonly high: Vec3 } | null {
    const cave = this.#loaded?.caves.start;
    if (cave === undefined) return null;
    const end = (side: number) => cave.middle.map((value, axis) => value + (side * cave.extentM[axis]!) / 2);
    return { low: end(-1) as Vec3, high: end(1) as Vec3 };
  }

  /** Where a point, in metres, is on the canvas: CSS pixels from the upper left corner. */
  project(point: Vec3): [x: number, y: number] {
    const { x, y } = new Vector3(...point).project(this.#cameraRig.camera);
    return [((x + 1) / 2) * this.#size.width, ((1 - y) / 2) * this.#size.height];
  }

  /** The agent at a position of the canvas in the last frame, CSS pixels. */
  pick(x: number, y: number): number | null {
    return this.#loaded?.team.pick(x, y) ?? null;
  }

  /** The moving obstacle at a position of the canvas in the last frame, CSS pixels. */
  obstacleAt(x: number, y: number): number | null {
    return this.#loaded?.obstacles.pick(x, y) ?? null;
  }

  /** The wall at a position of the canvas in the last frame, CSS pixels; null: there is none. */
  surfaceAt(x: number, y: number): SurfaceHit | null {
    const loaded = this.#loaded;
    if (loaded === null) return null;
    const { camera } = this.#cameraRig;
    const { width, height } = this.#size;
    const from = camera.position.toArray();
    const towards = new Vector3((2 * x) / width - 1, 1 - (2 * y) / height, 0.5).unproject(camera);
    const direction = towards.sub(camera.position).normalize().toArray();
    return surfaceHit(loaded.run.terrain, this.view.cut, from, direction);
  }

  /** Shows marks on the map, and the cells that a body reaches. */
  setMarks(marks: Marks, reach: CellSet | null): void {
    if (this.#loaded === null) return;
    this.#loaded.marks.show(marks);
    this.#isDirty = true;
    if (reach === this.#reach) return;
    this.#reach = reach;
    this.#loaded.caves.start.setReach(reach);
  }

  /** Must be called after `view` was changed. */
  viewChanged(): void {
    this.#isDirty = true;
  }

  /**
   * `isCoarse` favours the frame rate: without the faint walls towards the camera, which cost as
   * much as all others, and with a coarse cave unless the camera is near.
   */
  render(timeS: number, { isCoarse }: { readonly isCoarse: boolean } = { isCoarse: false }): void {
    const sinceMs = performance.now() - this.#lastFrameMs;
    const isFar = this.#cellPx() < NEAR_CELL_PX;
    const [least, most] = isCoarse && isFar ? COARSE_BUDGET_MS : BUDGET_MS;
    const budgetMs = Math.min(Math.max(sinceMs * BUDGET_SHARE, least), most);
    this.#draw(timeS, { budgetMs, isCoarse: isCoarse && isFar, skipsGlass: isCoarse });
  }

  /**
   * Builds a little more of what the full frame at this time needs. Returns whether it is complete.
   */
  prepare(timeS: number): boolean {
    return this.#loaded?.caves.at(timeS).prepare(tickAt(timeS), this.view, BUDGET_MS[1]) ?? true;
  }

  /** Resolves when the complete frame at this time has been drawn. Ends a flight. */
  async settled(timeS: number): Promise<void> {
    this.#cameraRig.endFlight();
    const loaded = this.#loaded;
    this.#draw(timeS, FULL_EFFORT);
    await this.#following;
    while (this.#loaded === loaded && this.#pendingHits !== null && this.#needsHits(timeS)) {
      await this.#pendingHits.answer;
      this.#draw(timeS, FULL_EFFORT);
    }
    if (this.#loaded === loaded && this.needsRedraw) this.#draw(timeS, FULL_EFFORT);
  }

  /**
   * Sets the size of the canvas in CSS pixels, its pixels per CSS pixel, and the share of this ratio
   * in which frames are drawn, except for their labels.
   */
  resize(width: number, height: number, pixelRatio: number, share: number): void {
    this.#size = { width: Math.max(width, 1), height: Math.max(height, 1) };
    for (const [uniforms, ratio] of [
      [this.#common, pixelRatio * share],
      [this.#labelCommon, pixelRatio],
    ] as const) {
      uniforms.pixelRatio.value = ratio;
      uniforms.frameSize.value
        .set(this.#size.width, this.#size.height)
        .multiplyScalar(ratio)
        .floor()
        .max(ONE);
    }
    this.#cameraRig.camera.aspect = this.#size.width / this.#size.height;
    // Positions of the image are looked up before the next frame too.
    this.#cameraRig.camera.updateProjectionMatrix();
    this.#isDirty = true;
  }

  dispose(): void {
    this.#clear();
    this.canvas.removeEventListener("webglcontextrestored", this.#restore);
    this.#cameraRig.dispose();
    this.#background.dispose();
    this.#hitPoints.dispose();
    this.#reduced.dispose();
    this.#renderer.dispose();
  }

  readonly #restore = (): void => {
    this.#loaded?.caves.rebuild();
    this.#isDirty = true;
  };

  #clear(): void {
    const loaded = this.#loaded;
    this.#loaded = null;
    this.#selected = null;
    this.#reach = null;
    this.#followed = null;
    this.#hits = null;
    this.#pendingHits = null;
    this.#isDirty = true;
    if (loaded === null) return;
    loaded.stopListening();
    this.#graph.remove(loaded.caves.root, loaded.team.root, loaded.obstacles.root);
    this.#labels.remove(loaded.team.labels);
    loaded.caves.dispose();
    loaded.team.dispose();
    loaded.obstacles.dispose();
    loaded.marks.dispose();
  }

  #draw(timeS: number, effort: RenderEffort): void {
    const beganMs = performance.now();
    this.#lastFrameMs = beganMs;
    this.#isDirty = false;
    this.#timeS = timeS;
    const loaded = this.#loaded;
    let built = 0;
    if (loaded !== null) {
      const { run, caves, team, obstacles } = loaded;
      const cave = caves.at(timeS);
      const { middle } = caves.start;
      this.#cameraRig.update(
        this.#selected === null ? middle : run.agentAt(this.#selected, timeS).position,
        middle,
      );
      this.#setCommon(timeS, cave);
      this.#follow(loaded);
      const skipsGlass = effort.skipsGlass && this.view.wallOpacity < GLASS_BELOW;
      const view = skipsGlass ? { ...this.view, wallOpacity: 0 } : this.view;
      const done = cave.show(this.#renderer, this.#common.nowTick.value, view, effort);
      this.#isIncomplete = !done.isComplete;
      built = done.built;
      const viewport = { camera: this.#cameraRig.camera, ...this.#size };
      team.show(timeS, view, this.#selected, viewport);
      obstacles.show(timeS, viewport);
      this.#showHits(loaded, timeS);
    } else {
      this.#hitPoints.show(null, [0, 0, 0]);
    }
    this.#setSize();
    const triangles = this.#renderAll();
    this.#stats = { triangles, chunksRebuilt: built, milliseconds: performance.now() - beganMs };
  }

  /** Renders the frame, and the labels over it. Returns the triangles of the frame. */
  #renderAll(): number {
    const renderer = this.#renderer;
    const { camera } = this.#cameraRig;
    const size = this.#common.frameSize.value;
    let triangles: number;
    if (size.equals(this.#labelCommon.frameSize.value)) {
      renderer.render(this.#graph, camera);
      triangles = renderer.info.render.triangles;
    } else {
      triangles = this.#reduced.render(renderer, this.#graph, camera, size);
    }
    renderer.autoClear = false;
    renderer.render(this.#labels, camera);
    renderer.autoClear = true;
    return triangles;
  }

  /** Size of a cell at the orbit's centre, at the end of a flight; CSS pixels. */
  #cellPx(): number {
    return (this.#loaded?.run.terrain.cellM ?? 0) / (pixelM(this.#size.height) * this.#cameraRig.distanceM);
  }

  /**
   * Applies the size of the canvas. This waits for the GPU, which is slow at first, so it comes
   * last.
   */
  #setSize(): void {
    const { x, y } = this.#labelCommon.frameSize.value;
    if (this.canvas.width !== x || this.canvas.height !== y) this.#renderer.setSize(x, y, false);
  }

  #setCommon(timeS: number, cave: Cave): void {
    const { camera } = this.#cameraRig;
    const common = this.#common;
    common.nowTick.value = tickAt(timeS);
    common.eye.value.copy(camera.position);
    common.paper.value = this.view.isOnWhite ? 1 : 0;
    this.#cameraRig.aimLight(common.light.value);
    const followed = this.#selected === null ? null : cave.run.agentAt(this.#selected, timeS).position;
    cave.setForegroundCut(camera.position.toArray(), followed);
    common.pixelM.value = pixelM(common.frameSize.value.y);
    const reachM = Math.hypot(...cave.extentM) / 2;
    const middleM = camera.position.distanceTo(new Vector3(...cave.middle));
    common.haze.value.set(Math.max(middleM - reachM * 0.75, 0), 1 / (reachM * 1.75));
  }

  #caveOrbit(cave: Cave): Orbit {
    const { extentM } = cave;
    // The flatter the map, the steeper the view.
    const flatness = Math.min(1, (extentM[2] * 2) / (extentM[0] + extentM[1]));
    const pitchRad = ((56 - 30 * flatness) * Math.PI) / 180;
    const orbit: Orbit = { centre: [0, 0, 0], yawRad: CAVE_YAW_RAD, pitchRad, distanceM: 1 };
    return { ...orbit, distanceM: this.#fitted(cave, orbit) };
  }

  /** The distance from which the whole cave is seen. */
  #fitted({ extentM, run }: Cave, orbit: Orbit): number {
    const aspect = this.#size.width / this.#size.height;
    // A map without agents has labels around it.
    const room = run.setup.agents === 0 ? 1.14 : 1.03;
    return distanceToFit(orbit, extentM, aspect) * room;
  }

  /** Follows the belief of the selected agent while the layer is shown. */
  #follow(loaded: LoadedRun): void {
    const wanted = this.view.layers.belief ? this.#selected : null;
    if (wanted === this.#followed) return;
    this.#followed = wanted;
    loaded.caves.setBelief(null);
    this.#following = loaded.run.follow(wanted).then((belief: Belief | null) => {
      if (this.#loaded !== loaded || this.#followed !== wanted) return;
      loaded.caves.setBelief(belief);
      this.#isDirty = true;
    });
  }

  /** Whether an update changes the picture of the present time. */
  #concerns({ fromS }: RunUpdate): boolean {
    const { heat, belief } = this.view.layers;
    // The scale of the heat map ends with the run; what an agent believes comes with the updates.
    return fromS <= this.#timeS || heat || (belief && this.#selected !== null);
  }

  #needsHits(timeS: number): boolean {
    const agent = this.view.layers.hits ? this.#selected : null;
    return (
      agent !== null && (this.#hits === null || this.#hits.agent !== agent || this.#hits.timeS !== timeS)
    );
  }

  /** Shows the last hits received, and requests those of this time unless a request is pending. */
  #showHits(loaded: LoadedRun, timeS: number): void {
    const agent = this.view.layers.hits ? this.#selected : null;
    if (agent !== null && this.#pendingHits === null && this.#needsHits(timeS)) {
      const answer = loaded.run.hitsAt(agent, timeS).then((hits) => {
        this.#pendingHits = null;
        if (this.#loaded !== loaded) return;
        this.#hits = { agent, timeS, hits };
        this.#isDirty = true;
      });
      this.#pendingHits = { agent, timeS, answer };
    }
    const shown = this.#hits !== null && this.#hits.agent === agent ? this.#hits.hits : null;
    const from: Vec3 =
      shown === null || agent === null ? [0, 0, 0] : loaded.run.agentAt(agent, shown.timeS).position;
    this.#hitPoints.show(shown, from);
  }
}

const ONE = new Vector2(1, 1);

/** Size of a pixel at a distance of one metre, for an image of this height in pixels. */
function pixelM(heightPx: number): number {
  return (2 * Math.tan(FIELD_OF_VIEW_RAD / 2)) / heightPx;
}

/** The tick at a time. The offset absorbs rounding: the start of a tick belongs to it. */
function tickAt(timeS: number): number {
  return Math.max(Math.floor(timeS / TICK_S + 1e-3), 0);
}
