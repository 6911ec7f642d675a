/**
 * The page: holds what is shown (run, time, selection, layers), passes orders on, and tells the panels. What a thing looks like is
 * in its own file.
 */
import type { Run } from "../data/run.ts";
import { openFile, openLive, openUrl } from "../data/sources.ts";
import type { LiveFeed } from "../data/sources.ts";
import { Scene } from "../scene/scene.ts";
import { Clock } from "./clock.ts";
import { openHelp } from "./dialogs.ts";
import type { HandleState } from "./handle.ts";
import { listenToKeys } from "./keys.ts";
import { browserSurroundings, LiveConnection, socketAddress } from "./live.ts";
import { Look } from "./look.ts";
import { Loop } from "./loop.ts";
import { AgentDigits, known, neighbour } from "./moment.ts";
import type { Moment } from "./moment.ts";
import { PLAY_RATES, shifted } from "./rates.ts";
import { STATE } from "./services.ts";
import { Shell } from "./shell.ts";

/** How often panels are told, seconds on the wall. */
const PANELS_S = 0.12;

/** How long the page waits to see whether a simulator has served it before it shows the other ways to a run. */
const QUIET_MS = 600;

/** What the address of the page asks for. */
export interface Wishes {
  readonly timeS: number | null;
  readonly agent: number | null;
  /** Nothing but the picture and a caption. */
  readonly isPicture: boolean;
}

export class App {
  readonly clock = new Clock();
  readonly shell: Shell;
  readonly scene: Scene | null;
  readonly loop: Loop;
  readonly ready: Promise<void>;
  run: Run | null = null;
  live: LiveConnection | null = null;
  #selected: number | null = null;
  #busy: string | null = null;
  /** Grows with each opening: one that was overtaken by another is dropped. */
  #opening = 0;
  #unlisten: () => void = () => undefined;
  #isReady: () => void = () => undefined;
  #panelsS = -Infinity;
  /** Whether the panels show something else than what is so. */
  #isStale = true;
  /** Whether the time that the address asks for has not been read yet. */
  #isSeeking = false;
  readonly #look: Look;
  #wishes: Wishes;
  readonly #digits = new AgentDigits();

  constructor(root: HTMLElement, wishes: Wishes) {
    this.#wishes = wishes;
    this.ready = new Promise((resolve) => (this.#isReady = resolve));
    const canvas = document.createElement("canvas");
    const { scene, problem } = sceneOn(canvas, wishes.isPicture);
    this.scene = scene;
    this.#look = new Look(!wishes.isPicture);
    if (scene) this.#look.applyTo(scene.view);
    this.clock.rate = this.#look.values.rate;
    this.shell = new Shell(root, canvas, this, scene?.view ?? null, wishes.isPicture);
    this.shell.banners.set("graphics", problem);
    this.loop = new Loop(canvas, scene, {
      advance: (wallS) => this.#advance(wallS),
      drew: (wallS, isDrawn) => this.#drew(wallS, isDrawn),
      failed: (error) => this.shell.banners.set("picture", `The picture cannot be drawn: ${error.message}`),
    });
    this.shell.onResize((width, height) => this.loop.resize(width, height));
    this.shell.onPick((x, y) => {
      const agent = this.scene?.pick(x, y) ?? null;
      if (agent !== null) this.select(agent);
    });
    for (const event of ["pointerdown", "pointermove", "pointerup", "wheel"]) {
      canvas.addEventListener(event, () => this.loop.request(), { passive: true });
    }
    if (!wishes.isPicture) this.#listen();
    this.#applyLook();
  }

  // ---------------------------------------------------------------- opening

  openFile(file: File): Promise<void> {
    return this.#open(`Opening ${file.name}`, () => openFile(file));
  }

  openUrl(url: string): Promise<void> {
    return this.#open(`Opening ${url}`, () => openUrl(url));
  }

  async #open(busy: string, open: () => Promise<Run>): Promise<void> {
    this.disconnect();
    const opening = ++this.#opening;
    this.shell.banners.set("opening", null);
    this.#setBusy(busy);
    try {
      const run = await open();
      if (opening !== this.#opening) run.close();
      else this.#show(run);
    } catch (error) {
      if (opening === this.#opening) this.shell.banners.set("opening", (error as Error).message);
    } finally {
      if (opening === this.#opening) this.#setBusy(null);
    }
  }

  /** Gives up what is being opened. */
  cancel(): void {
    this.#opening += 1;
    this.disconnect();
    this.#setBusy(null);
  }

  /** Connects with a simulator. `isQuiet`: that there is none is no problem. */
  connect(address: string, isQuiet = false): void {
    this.disconnect();
    this.#opening += 1;
    const url = socketAddress(address);
    this.#setBusy(isQuiet ? "Looking for a simulator" : `Connecting with ${url}`);
    // A server that is no simulator may leave the attempt without an answer: nobody is to wait for that.
    if (isQuiet) setTimeout(() => this.live?.state === "connecting" && this.#setBusy(null), QUIET_MS);
    const hooks = {
      changed: () => this.#liveChanged(isQuiet),
      feedOpened: (feed: LiveFeed) => void this.#feedOpened(feed),
    };
    // The constructor may tell of changes already, before there is anything to tell of.
    this.live = null;
    this.live = new LiveConnection(url, hooks, browserSurroundings(openLive), { once: isQuiet });
    this.#liveChanged(isQuiet);
  }

  disconnect(): void {
    this.live?.close();
    this.live = null;
    this.shell.banners.set("connection", null);
  }

  async #feedOpened(feed: LiveFeed): Promise<void> {
    const opening = ++this.#opening;
    this.shell.startForm.close();
    try {
      const run = await feed.run;
      if (opening !== this.#opening) run.close();
      else this.#show(run);
    } catch (error) {
      if (opening === this.#opening) this.shell.banners.set("opening", (error as Error).message);
    }
  }

  #liveChanged(isQuiet: boolean): void {
    const live = this.live;
    if (!live) return;
    if (live.state === "closed") {
      this.live = null;
      this.#setBusy(null);
      if (!isQuiet) this.shell.banners.set("connection", live.problem);
    } else {
      const isOver = live.hasEnded && live.state === "lost";
      const text = isOver
        ? "The run is over and its simulator has left. If another one comes, it is shown."
        : live.problem;
      // Before there was any connection, the welcome screen says what is tried.
      const kind = isOver ? "notice" : "warning";
      this.shell.banners.set("connection", live.state === "connecting" && isQuiet ? null : text, kind);
      if (live.state === "open") this.#setBusy(live.session === "" ? null : "Receiving the run");
    }
    this.#changed();
  }

  #setBusy(busy: string | null): void {
    this.#busy = busy;
    this.#changed();
  }

  #show(run: Run): void {
    this.#unlisten();
    this.run?.close();
    this.run = run;
    this.#busy = null;
    const wasSelected = this.#selected;
    this.#selected = null;
    this.clock.reset();
    this.scene?.setRun(run);
    this.#unlisten = run.onNews(() => this.loop.request());
    document.title = `${run.title} - MAES viewer`;
    const { timeS, agent } = this.#wishes;
    this.#wishes = { ...this.#wishes, timeS: null, agent: null };
    this.#isSeeking = timeS !== null;
    if (timeS !== null) void this.#seekWhenKnown(run, timeS);
    else if (this.live) this.clock.follow();
    const wanted = agent ?? (this.live ? wasSelected : null);
    if (wanted !== null && wanted < run.setup.agents) this.select(wanted, false);
    this.#changed();
  }

  async #seekWhenKnown(run: Run, timeS: number): Promise<void> {
    await known(run, timeS);
    if (this.run !== run) return;
    this.#isSeeking = false;
    this.seek(timeS);
  }

  // ---------------------------------------------------------------- orders

  get selected(): number | null {
    return this.#selected;
  }

  select(agent: number | null, isFlown = true): void {
    if (agent !== null && (!this.run || agent >= this.run.setup.agents)) return;
    this.#selected = agent;
    this.scene?.select(agent, { fly: isFlown });
    this.#changed();
  }

  selectNeighbour(step: 1 | -1): void {
    if (this.run) this.select(neighbour(this.#selected, step, this.run.setup.agents));
  }

  seek(timeS: number): void {
    if (!this.run) return;
    this.clock.seek(timeS, this.run.endS);
    this.#changed();
  }

  /** The simulator while it is followed, else the picture. */
  togglePlay(): void {
    const { run, live, clock } = this;
    if (!run) return;
    if (live && clock.isFollowing && !run.isComplete) {
      if (live.canControl)
        this.order((it) => (it.simulationState === STATE.playing ? it.pause() : it.play()));
    } else if (clock.isPlaying) clock.isPlaying = false;
    else clock.play(run.endS, run.isComplete);
    this.#changed();
  }

  setRate(rate: number): void {
    this.clock.rate = rate;
    this.#look.change({ rate });
    this.#changed();
  }

  goLive(): void {
    if (!this.live || !this.run) return;
    this.clock.follow();
    this.#changed();
  }

  /** Has the simulator do something; a refusal is shown. */
  order(what: (live: LiveConnection) => Promise<void> | void): void {
    const live = this.live;
    if (!live) return;
    this.shell.banners.set("order", null);
    Promise.resolve()
      .then(() => what(live))
      .catch((error: unknown) => this.shell.banners.set("order", (error as Error).message, "warning"));
  }

  async startRun(scenario: string): Promise<string | null> {
    if (!this.live) throw new Error("There is no connection with a simulator.");
    return this.live.start(scenario);
  }

  viewChanged(): void {
    const view = this.scene?.view;
    if (!view) return;
    this.scene.viewChanged();
    this.#look.takeFrom(view);
    this.#changed();
  }

  setUnexplored(isShown: boolean): void {
    if (!this.scene) return;
    this.scene.view.layers.unexplored = isShown;
    this.viewChanged();
  }

  togglePart(part: "isPanelOpen" | "isLayersOpen" | "isFiguresOpen"): void {
    this.#look.change({ [part]: !this.#look.values[part] });
    this.#applyLook();
    this.#changed();
  }

  get rate(): number {
    return this.clock.rate;
  }

  /** Holds the picture at a time and draws exactly that. */
  async showAt(timeS: number): Promise<void> {
    await this.ready;
    const run = this.run;
    if (!run) throw new Error("There is no run to show.");
    await known(run, timeS);
    this.clock.isPlaying = false;
    this.seek(timeS);
    await this.loop.drawExactly(this.clock.timeS);
    this.#updatePanels(performance.now() / 1000);
  }

  get state(): HandleState {
    const { clock, live } = this;
    return {
      timeS: clock.timeS,
      isPlaying: clock.isPlaying,
      isFollowing: clock.isFollowing,
      rate: clock.rate,
      selected: this.#selected,
      link: live?.state ?? null,
      problems: Object.fromEntries(this.shell.banners.texts),
    };
  }

  // ---------------------------------------------------------------- pictures

  #advance(wallS: number): { timeS: number; isMoving: boolean } {
    const { run, clock } = this;
    if (!run) return { timeS: 0, isMoving: false };
    const before = clock.timeS;
    clock.advance(wallS, run.endS, run.isComplete, this.live !== null);
    return { timeS: clock.timeS, isMoving: clock.isMoving || clock.timeS !== before };
  }

  #drew(wallS: number, isDrawn: boolean): void {
    if (isDrawn) {
      this.shell.figures.drawn(wallS);
      this.#isStale = true;
    }
    // While things move panels are told now and then; when they have come to rest, of all.
    if (!this.#isStale || (isDrawn && wallS - this.#panelsS < PANELS_S)) return;
    this.#updatePanels(wallS);
    if (this.run && !this.#isSeeking) this.#isReady();
  }

  #updatePanels(wallS: number): void {
    this.#panelsS = wallS;
    this.#isStale = false;
    const { run, clock, live, scene, shell } = this;
    const moment: Moment | null = run && {
      run,
      timeS: clock.timeS,
      selected: this.#selected,
      live,
      pace: clock.pace,
    };
    shell.update(moment, clock, live, this.#busy);
    shell.figures.update(wallS, scene, this.loop.pacer.costMs, this.loop.pixelRatio);
    shell.banners.set("run", run?.problem ?? null, "warning");
    shell.banners.set("scene", scene && scene.notices.length > 0 ? scene.notices.join(" ") : null, "notice");
  }

  #changed(): void {
    this.#panelsS = -Infinity;
    this.loop.request();
  }

  #applyLook(): void {
    const { isPanelOpen, isLayersOpen, isFiguresOpen } = this.#look.values;
    this.shell.setParts(isPanelOpen, isLayersOpen, isFiguresOpen);
  }

  #listen(): void {
    listenToKeys({
      togglePlay: () => this.togglePlay(),
      seekBy: (stepS) => this.seek(this.clock.timeS + stepS),
      seekTo: (end) => this.seek(end === "start" ? 0 : Infinity),
      changeRate: (steps) => this.setRate(shifted(PLAY_RATES, this.clock.rate, steps)),
      goLive: () => this.goLive(),
      digit: (digit) => {
        const agent = this.#digits.typed(digit, performance.now(), this.run?.setup.agents ?? 0);
        if (agent !== null) this.select(agent);
      },
      step: (step) => this.selectNeighbour(step),
      cave: () => this.select(null),
      toggleUnexplored: () => this.setUnexplored(!this.scene?.view.layers.unexplored),
      toggleLayers: () => this.togglePart("isLayersOpen"),
      togglePanel: () => this.togglePart("isPanelOpen"),
      toggleFigures: () => this.togglePart("isFiguresOpen"),
      help: openHelp,
    });
  }
}

function sceneOn(
  canvas: HTMLCanvasElement,
  isForPictures: boolean,
): { scene: Scene | null; problem: string | null } {
  try {
    return { scene: new Scene(canvas, { isForPictures }), problem: null };
  } catch (error) {
    return { scene: null, problem: (error as Error).message };
  }
}
