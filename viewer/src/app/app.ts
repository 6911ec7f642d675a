/**
 * The application: owns the state of the page (run, time, selection, layers), executes actions, and
 * updates the panels. Each part of the page is rendered in its own module.
 */
import { roomAt, type AskRoom } from "../data/map-room.ts";
import type { Run } from "../data/run.ts";
import { openFile, openLive, openUrl } from "../data/sources.ts";
import type { LiveFeed } from "../data/sources.ts";
import { Scene } from "../scene/scene.ts";
import { AgentNumberInput, nextSelection } from "./agent-selection.ts";
import { axisLabels } from "./axes.ts";
import { Clock } from "./clock.ts";
import { captureName, MovieCapture, savePicture } from "./captures.ts";
import { openDialog, openHelp } from "./dialogs.ts";
import { el } from "./dom.ts";
import { PLAYBACK_EVENT, type HandleState, type Playback } from "./handle.ts";
import { listenToKeys } from "./keys.ts";
import { browserEnvironment, LiveConnection, socketAddress } from "./live.ts";
import { MapEdit } from "./map-edit.ts";
import { hoverName } from "./hover-name.ts";
import { MapRoom } from "./map-room.ts";
import { ViewSettings } from "./view-settings.ts";
import { RenderLoop } from "./render-loop.ts";
import { lineEndS } from "./timeline-axis.ts";
import { waitUntilKnown } from "./panel-state.ts";
import type { PageActions, PagePart } from "./page-actions.ts";
import type { PanelState } from "./panel-state.ts";
import { PLAY_RATES, shifted } from "./rates.ts";
import { STATE } from "./services.ts";
import { linkTo, parseLink, type SharedView } from "./shared-link.ts";
import { Shell } from "./shell.ts";

/** Period of panel updates, seconds of wall time. */
const PANEL_PERIOD_S = 0.12;

/**
 * Time to probe for a simulator that serves the page, before other ways to open a run are shown.
 */
const PROBE_MS = 600;

/** Time after which the panels are shown in any case, so that a long opening can be cancelled. */
const OPENING_MS = 3000;

/** Time for the full picture before the rest of a recording is read. */
const FULL_PICTURE_MS = 1500;

/** Period of updates of the panels while a recording is read. */
const READING_PERIOD_MS = 250;

const NO_VIEW: SharedView = parseLink("");

/** Options in the address of the page. */
export interface PageOptions {
  /** What is shown first. */
  readonly view: SharedView;
  /** Whether only the image and a caption are shown. */
  readonly isPicture: boolean;
  /** Address of the answers to questions about the map; null: no server answers. */
  readonly room: string | null;
}

export class App implements PageActions {
  readonly clock = new Clock();
  readonly shell: Shell;
  readonly scene: Scene | null;
  readonly loop: RenderLoop;
  readonly ready: Promise<void>;
  /** The box of a change of the map of a live run. */
  readonly mapEdit = new MapEdit(() => {
    this.scene?.setMarks({ measured: this.mapEdit.corners, starts: [] }, null);
    this.#changed();
  });
  run: Run | null = null;
  live: LiveConnection | null = null;
  #selected: number | null = null;
  /** The tools for a map; null: a run is shown, or nothing. */
  #room: MapRoom | null = null;
  #busy: string | null = null;
  /** Incremented by every opening; an opening that was superseded is dropped. */
  #opening = 0;
  #unlisten: () => void = () => undefined;
  #isReady: () => void = () => undefined;
  #panelsUpdatedS = -Infinity;
  /** Whether the panels are out of date. */
  #isStale = true;
  /** Whether the time in the address has not been read yet. */
  #isSeeking = false;
  #movie: MovieCapture | null = null;
  /** The playback of a page beside this one, until a run is there. */
  #followed: Playback | null = null;
  /** Whether an update of the panels is scheduled. */
  #isWaking = false;
  /** Whether a complete frame of the run has been drawn. */
  #hasPicture = false;
  /** Whether the recording plays once its first picture is there: the user has not touched it. */
  #mayPlay = false;
  /** The least length of the timeline, that of a page beside this one. */
  #scaleS = 0;
  readonly #settings: ViewSettings;
  #options: PageOptions;
  readonly #digits = new AgentNumberInput();

  constructor(root: HTMLElement, options: PageOptions) {
    this.#options = options;
    this.ready = new Promise((resolve) => (this.#isReady = resolve));
    const { scene, problem } = createScene(options.isPicture);
    const canvas = scene?.canvas ?? document.createElement("canvas");
    this.scene = scene;
    this.#settings = new ViewSettings(!options.isPicture);
    if (scene) {
      this.#settings.applyTo(scene.view);
      // Those of an address are not stored: whoever made the link chose them.
      Object.assign(scene.view.layers, options.view.layers);
    }
    this.clock.rate = this.#settings.values.rate;
    this.shell = new Shell(root, canvas, this, scene?.view ?? null, options.isPicture);
    this.shell.banners.set("graphics", problem);
    this.loop = new RenderLoop(canvas, scene, {
      advance: (wallS) => this.#advance(wallS),
      frameDone: (wallS, isDrawn) => this.#afterFrame(wallS, isDrawn),
      frameFinished: (isFull) => this.#frameFinished(isFull),
      failed: (error) => {
        this.shell.banners.set("render", `Rendering failed: ${error.message}`);
        this.#frameFinished(true);
      },
    });
    this.shell.onResize((width, height) => this.loop.resize(width, height));
    this.shell.onPick((x, y) => {
      const hit = this.scene?.surfaceAt(x, y) ?? null;
      this.#room?.clicked(hit);
      this.mapEdit.clicked(hit);
      if (this.mapEdit.isOn) return;
      const agent = this.scene?.pick(x, y) ?? null;
      if (agent !== null) this.select(agent);
    });
    this.shell.onHover((x, y) => hoverName(this.scene?.pick(x, y), this.scene?.obstacleAt(x, y)));
    for (const event of ["pointerdown", "pointermove", "pointerup", "wheel"]) {
      canvas.addEventListener(event, () => this.loop.request(), { passive: true });
    }
    document.addEventListener("visibilitychange", () => document.hidden && this.run?.readOn());
    if (!options.isPicture) this.#listen();
    this.#applySettings();
  }

  // ---------------------------------------------------------------- opening

  openFile(file: File): Promise<void> {
    return this.#open(`Opening ${file.name}`, () => openFile(file));
  }

  /**
   * Shows the recording of the address. The panels come after the first picture, because drawing
   * them takes as long as drawing it.
   */
  openFirst(url: string, opening: Promise<Run>): Promise<void> {
    this.shell.setOpening(true);
    setTimeout(() => this.run === null && this.shell.setOpening(false), OPENING_MS);
    return this.#open(`Opening ${url}`, () => opening);
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
      if (opening === this.#opening) {
        this.#setBusy(null);
        if (this.run === null) this.shell.setOpening(false);
      }
    }
  }

  /** Cancels the opening in progress. */
  cancel(): void {
    this.#opening += 1;
    this.disconnect();
    this.shell.setOpening(false);
    this.#setBusy(null);
  }

  /** Connects to a simulator. A probe does not report that there is none. */
  connect(address: string, isProbe = false): void {
    this.disconnect();
    this.#opening += 1;
    const url = socketAddress(address);
    this.#setBusy(isProbe ? "Looking for a simulator" : `Connecting to ${url}`);
    // Another kind of server may not answer at all: do not keep the user waiting.
    if (isProbe) setTimeout(() => this.live?.state === "connecting" && this.#setBusy(null), PROBE_MS);
    const listener = {
      changed: () => this.#liveChanged(isProbe),
      feedOpened: (feed: LiveFeed) => void this.#feedOpened(feed),
    };
    // The constructor may already call the listener, before `live` is assigned.
    this.live = null;
    this.live = new LiveConnection(url, listener, browserEnvironment(openLive), { once: isProbe });
    this.#liveChanged(isProbe);
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

  #liveChanged(isProbe: boolean): void {
    const live = this.live;
    if (!live) return;
    if (live.state === "closed") {
      this.live = null;
      this.#setBusy(null);
      if (!isProbe) this.shell.banners.set("connection", live.problem);
    } else {
      const isOver = live.hasEnded && live.state === "lost";
      const text = isOver
        ? "The run is over and its simulator has exited. A new one at this address will be shown."
        : live.problem;
      // While a probe is connecting, the welcome screen shows its state.
      const kind = isOver ? "notice" : "warning";
      this.shell.banners.set("connection", live.state === "connecting" && isProbe ? null : text, kind);
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
    this.#unlisten = run.onUpdate(() => this.#updated());
    document.title = `${run.title} - MAES viewer`;
    const { timeS, agent, camera } = this.#options.view;
    this.#room = run.setup.agents === 0 ? this.#roomOf(run) : null;
    this.#options = { ...this.#options, view: NO_VIEW, room: null };
    this.#isSeeking = timeS !== null;
    this.#mayPlay =
      this.live === null &&
      timeS === null &&
      run.setup.agents > 0 &&
      !this.#options.isPicture &&
      !matchMedia("(prefers-reduced-motion: reduce)").matches;
    if (timeS !== null) void this.#seekWhenKnown(run, timeS);
    else if (this.live) this.clock.follow();
    const wanted = agent ?? (this.live ? wasSelected : null);
    if (wanted !== null && wanted < run.setup.agents) this.select(wanted, false);
    if (camera !== null) this.scene?.setOrbit(camera);
    if (this.#followed) this.follow(this.#followed);
    this.#hasPicture = false;
    if (this.scene === null) this.shell.setOpening(false);
    if (this.#isSeeking || this.scene === null || document.hidden) run.readOn();
    this.#changed();
  }

  /** The tools for a map. Only the map of the address has somebody who answers. */
  #roomOf({ terrain }: Run): MapRoom {
    const { room } = this.#options;
    const ask: AskRoom | null = room === null ? null : roomAt(new URL(room, location.href).href);
    const tools: MapRoom = new MapRoom(ask, terrain.walls.length, () => {
      this.scene?.setMarks(tools, tools.reach);
      this.#changed();
    });
    return tools;
  }

  /** More of the run is known. */
  #updated(): void {
    this.#isStale = true;
    // Most of what is read of a recording changes the panels only.
    if (this.clock.isAwaiting) this.loop.request();
    else if (this.scene === null || this.scene.needsRedraw || this.run?.isComplete) this.loop.wake();
    else if (!this.#isWaking) {
      this.#isWaking = true;
      setTimeout(() => this.#wake(), READING_PERIOD_MS);
    }
  }

  #wake(): void {
    this.#isWaking = false;
    this.loop.wake();
  }

  async #seekWhenKnown(run: Run, timeS: number): Promise<void> {
    await waitUntilKnown(run, timeS);
    if (this.run !== run) return;
    this.#isSeeking = false;
    this.seek(timeS);
  }

  // ---------------------------------------------------------------- actions

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
    if (this.run) this.select(nextSelection(this.#selected, step, this.run.setup.agents));
  }

  seek(timeS: number): void {
    if (!this.run) return;
    this.#mayPlay = false;
    this.clock.seek(timeS, this.run.endS, this.#isGrowing);
    this.#playbackChanged();
  }

  get playback(): Playback {
    const { wantedS, isPlaying, rate } = this.clock;
    return { timeS: wantedS, isPlaying, rate };
  }

  /** Takes over the playback of a page beside this one, before or after the run is there. */
  follow(playback: Playback): void {
    const { run, clock } = this;
    this.#followed = run ? null : playback;
    this.#mayPlay = false;
    if (!run) return;
    clock.rate = playback.rate;
    clock.seek(playback.timeS, run.endS, this.#isGrowing);
    clock.isPlaying = playback.isPlaying && (this.#isGrowing || playback.timeS < run.endS);
    this.#changed();
  }

  get lineEndS(): number {
    const { run } = this;
    return run === null ? 0 : lineEndS(run.endS, run.setup.durationS, run.isComplete);
  }

  scaleTo(endS: number): void {
    if (endS === this.#scaleS) return;
    this.#scaleS = endS;
    this.#changed();
  }

  /** Whether a recording is shown whose rest is still being read. */
  get #isGrowing(): boolean {
    return this.run?.isComplete === false && this.live === null;
  }

  /** Toggles the simulator while it is followed, else the playback. */
  togglePlay(): void {
    const { run, live, clock } = this;
    if (!run) return;
    this.#mayPlay = false;
    if (live && clock.isFollowing && !run.isComplete) {
      if (live.canControl)
        this.control((it) => (it.simulationState === STATE.playing ? it.pause() : it.play()));
    } else if (clock.isPlaying) clock.isPlaying = false;
    else clock.play(run.endS, run.isComplete);
    this.#playbackChanged();
  }

  setRate(rate: number): void {
    this.clock.rate = rate;
    this.#settings.change({ rate });
    this.#playbackChanged();
  }

  goLive(): void {
    if (!this.live || !this.run) return;
    this.clock.follow();
    this.#changed();
  }

  /** Sends a command to the simulator; an error is shown as a banner. */
  control(what: (live: LiveConnection) => Promise<void> | void): void {
    const live = this.live;
    if (!live) return;
    this.shell.banners.set("control", null);
    Promise.resolve()
      .then(() => what(live))
      .catch((error: unknown) => this.shell.banners.set("control", (error as Error).message, "warning"));
  }

  async startRun(scenario: string, isRecorded: boolean): Promise<string | null> {
    if (!this.live) throw new Error("Not connected to a simulator.");
    const { refusal, recording } = await this.live.start(scenario, isRecorded);
    const file = `The run is recorded as ${recording} in the simulator's folder of recordings (--record-dir).`;
    this.shell.banners.set("recording", recording === null ? null : file, "notice");
    return refusal;
  }

  viewChanged(): void {
    const view = this.scene?.view;
    if (!view) return;
    this.scene.viewChanged();
    this.#settings.copyFrom(view);
    this.#changed();
  }

  setUnexplored(isShown: boolean): void {
    if (!this.scene) return;
    this.scene.view.layers.unexplored = isShown;
    this.viewChanged();
  }

  togglePart(part: PagePart): void {
    this.#settings.change({ [part]: !this.#settings.values[part] });
    this.#applySettings();
    this.#changed();
  }

  get rate(): number {
    return this.clock.rate;
  }

  get link(): string {
    return linkTo(location.href, {
      timeS: this.clock.isFollowing ? null : this.clock.timeS,
      agent: this.#selected,
      layers: this.scene ? { ...this.scene.view.layers } : null,
      camera: this.scene?.orbit ?? null,
    });
  }

  async copyLink(): Promise<void> {
    const { link } = this;
    try {
      await navigator.clipboard.writeText(link);
      this.shell.banners.set("share", "The link to this view is on the clipboard.", "notice");
    } catch {
      // Not every page may write to the clipboard: an address without TLS, for example.
      openDialog("Link to this view", "share", el("p", {}, el("code", { testid: "share-link" }, link)));
    }
  }

  async savePicture(): Promise<void> {
    const { run, scene } = this;
    if (!run || !scene) return;
    const { timeS } = this.clock;
    await this.loop.drawExactly(timeS);
    const name = captureName(run.title, timeS, "png");
    await savePicture(scene.canvas, name, () => scene.render(timeS)).catch((error: unknown) =>
      this.shell.banners.set("capture", (error as Error).message, "warning"),
    );
  }

  /** Begins to capture a movie of the image, or ends it and saves what was captured. */
  async toggleMovie(): Promise<void> {
    const { run, scene } = this;
    if (!run || !scene) return;
    try {
      const capture = this.#movie;
      this.#movie = null;
      if (capture) await capture.end((extension) => captureName(run.title, this.clock.timeS, extension));
      else this.#movie = new MovieCapture(scene.canvas);
      const text = "A movie of the image is being captured; press the button again to save it.";
      this.shell.banners.set("capture", this.#movie ? text : null, "notice");
    } catch (error) {
      this.shell.banners.set("capture", (error as Error).message, "warning");
    }
    this.shell.setCapturing(this.#movie !== null);
  }

  /** Pauses at a time and renders it in full. */
  async showAt(timeS: number): Promise<void> {
    await this.ready;
    const run = this.run;
    if (!run) throw new Error("There is no run to show.");
    await waitUntilKnown(run, timeS);
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
      connection: live?.state ?? null,
      problems: Object.fromEntries(this.shell.banners.texts),
    };
  }

  // ---------------------------------------------------------------- frames

  #advance(wallS: number): { timeS: number; isMoving: boolean } {
    const { run, clock } = this;
    if (!run) return { timeS: 0, isMoving: false };
    const before = clock.timeS;
    clock.advance(wallS, run.endS, run.isComplete, this.live !== null);
    return { timeS: clock.timeS, isMoving: clock.isMoving || clock.timeS !== before };
  }

  /**
   * The GPU has finished a frame: after the first one of a run come the panels and the same picture
   * in full, and then the rest of the recording is read.
   */
  #frameFinished(isFull: boolean): void {
    const { run, scene } = this;
    if (!run || this.#isSeeking || scene?.needsRedraw) return;
    if (isFull) run.readOn();
    if (this.#hasPicture) return;
    this.#hasPicture = true;
    this.loop.hurry();
    this.shell.setOpening(false);
    if (this.#mayPlay) this.clock.play(run.endS, run.isComplete);
    this.#updatePanels(performance.now() / 1000);
    this.#isReady();
    setTimeout(() => run.readOn(), FULL_PICTURE_MS);
  }

  #afterFrame(wallS: number, isDrawn: boolean): void {
    if (isDrawn) {
      this.shell.renderStats.frameDrawn(wallS);
      this.#isStale = true;
    }
    // Panels are updated periodically while frames are drawn, and once more at rest.
    if (!this.#isStale || (isDrawn && wallS - this.#panelsUpdatedS < PANEL_PERIOD_S)) return;
    this.#updatePanels(wallS);
    if (this.run && this.scene === null && !this.#isSeeking) this.#isReady();
  }

  #updatePanels(wallS: number): void {
    this.#panelsUpdatedS = wallS;
    this.#isStale = false;
    const { run, clock, live, scene, shell } = this;
    const panel: PanelState | null = run && {
      run,
      timeS: clock.timeS,
      selected: this.#selected,
      live,
      realTimeFactor: clock.realTimeFactor,
      lineEndS: Math.max(this.lineEndS, this.#scaleS),
    };
    shell.update(panel, this.#room, clock, live, this.#busy);
    const isMap = run?.setup.agents === 0;
    if (scene) shell.legend.update(scene.view, scene.pixelM, isMap, (run?.setup.obstacles.length ?? 0) > 0);
    // In a run, labels would cover agents.
    const box = isMap ? scene?.box : null;
    shell.axes.update(scene && box ? axisLabels(box, (point) => scene.project(point)) : []);
    shell.renderStats.update(wallS, scene, this.loop.pacer.costMs, this.loop.pixelRatio);
    shell.banners.set("run", run?.problem ?? null, "warning");
    shell.banners.set("scene", scene && scene.notices.length > 0 ? scene.notices.join(" ") : null, "notice");
  }

  #playbackChanged(): void {
    this.#changed();
    window.dispatchEvent(new Event(PLAYBACK_EVENT));
  }

  #changed(): void {
    this.#panelsUpdatedS = -Infinity;
    this.loop.request();
  }

  #applySettings(): void {
    const { isPanelOpen, isLayersOpen, areStatsOpen } = this.#settings.values;
    this.shell.setParts(isPanelOpen, isLayersOpen, areStatsOpen);
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
      moveCamera: (change) => {
        this.scene?.moveCamera(change);
        this.loop.request();
      },
      toggleUnexplored: () => this.setUnexplored(!this.scene?.view.layers.unexplored),
      toggleLayers: () => this.togglePart("isLayersOpen"),
      togglePanel: () => this.togglePart("isPanelOpen"),
      toggleStats: () => this.togglePart("areStatsOpen"),
      help: openHelp,
    });
  }
}

function createScene(isForPictures: boolean): { scene: Scene | null; problem: string | null } {
  try {
    return { scene: new Scene({ isForPictures }), problem: null };
  } catch (error) {
    return { scene: null, problem: (error as Error).message };
  }
}
