/**
 * Layout of the page: creates its parts, shows or hides them, and passes state and actions on.
 * Contains no logic of its own.
 */
import type { View } from "../scene/scene.ts";
import { AgentCard, AgentsCard } from "./agents-card.ts";
import { Axes } from "./axes.ts";
import { Banners } from "./banners.ts";
import { CameraBar } from "./camera-bar.ts";
import { card, CountersCard, RunCard, ScenarioCard } from "./cards.ts";
import type { Clock } from "./clock.ts";
import { ProgressChart } from "./progress-chart.ts";
import { openHelp } from "./dialogs.ts";
import { el, iconButton, setHidden, setIcon, setText } from "./dom.ts";
import { RenderStats } from "./render-stats.ts";
import { LayersPanel } from "./layers-panel.ts";
import { MapCard } from "./map-card.ts";
import type { MapEdit } from "./map-edit.ts";
import type { MapRoom } from "./map-room.ts";
import { Legend } from "./legend.ts";
import type { LiveConnection } from "./live.ts";
import type { PageActions } from "./page-actions.ts";
import type { PanelState } from "./panel-state.ts";
import { captionOf, SceneName } from "./scene-text.ts";
import { SimulatorCard } from "./simulator-card.ts";
import { StartForm } from "./start-form.ts";
import { PlaybackBar } from "./playback-bar.ts";
import { Welcome } from "./welcome.ts";

/** A pointer that has moved farther than this between press and release has dragged, pixels. */
const CLICK_PX = 4;

export class Shell {
  readonly banners = new Banners();
  readonly renderStats = new RenderStats();
  readonly startForm: StartForm;
  readonly #stage: HTMLElement;
  readonly #canvas: HTMLCanvasElement;
  readonly #frame: HTMLElement;
  readonly #welcome: Welcome;
  readonly #playbackBar: PlaybackBar;
  readonly #camera: CameraBar;
  readonly #layers: LayersPanel | null;
  readonly #simulator: SimulatorCard;
  readonly #map = new MapCard();
  readonly #mapEdit: MapEdit;
  readonly #run = new RunCard();
  readonly #agents: AgentsCard;
  readonly #agent: AgentCard;
  readonly #chart: ProgressChart;
  readonly #chartCard: HTMLDetailsElement;
  readonly #counters = new CountersCard();
  readonly #scenario = new ScenarioCard();
  readonly #sceneName: SceneName;
  readonly #caption = el("div", { class: "caption", testid: "caption" });
  readonly legend = new Legend();
  readonly axes = new Axes();
  readonly #movie: HTMLButtonElement;
  readonly #toolbar: HTMLElement;
  readonly #view: View | null;
  readonly #isPicture: boolean;
  #isOpening = false;

  constructor(
    root: HTMLElement,
    canvas: HTMLCanvasElement,
    actions: PageActions,
    view: View | null,
    isPicture: boolean,
  ) {
    this.#canvas = canvas;
    this.#mapEdit = actions.mapEdit;
    this.#view = view;
    this.#isPicture = isPicture;
    canvas.className = "canvas";
    canvas.setAttribute("data-testid", "canvas");
    this.#sceneName = new SceneName(canvas);

    const file = el("input", { type: "file", accept: ".mcap,.m3dm", hidden: true, testid: "file" });
    file.addEventListener("change", () => {
      const chosen = file.files?.[0];
      file.value = "";
      if (chosen) void actions.openFile(chosen);
    });
    const chooseFile = () => file.click();
    this.startForm = new StartForm((scenario, isRecorded) => actions.startRun(scenario, isRecorded));
    const newRun = () => this.startForm.open();
    this.#welcome = new Welcome({
      chooseFile,
      openUrl: (url) => void actions.openUrl(url),
      connect: (address) => actions.connect(address),
      newRun,
      cancel: () => actions.cancel(),
    });
    this.#playbackBar = new PlaybackBar({
      togglePlay: () => actions.togglePlay(),
      seek: (timeS) => actions.seek(timeS),
      setRate: (rate) => actions.setRate(rate),
      goLive: () => actions.goLive(),
    });
    this.#camera = new CameraBar(
      {
        step: (step) => actions.selectNeighbour(step),
        cave: () => actions.select(null),
        setUnexplored: (isShown) => actions.setUnexplored(isShown),
      },
      view?.layers.unexplored ?? true,
    );
    this.#layers =
      view &&
      new LayersPanel(
        view,
        () => actions.viewChanged(),
        () => actions.togglePart("isLayersOpen"),
      );
    this.#simulator = new SimulatorCard({
      mapEdit: actions.mapEdit,
      control: (what) => actions.control(what),
      newRun,
    });
    this.#agents = new AgentsCard((agent) => actions.select(agent));
    this.#agent = new AgentCard(() => actions.select(null));
    this.#chart = new ProgressChart((timeS) => actions.seek(timeS));
    this.#chartCard = card("Progress over time", "chart-card", true, this.#chart.root);
    this.#movie = iconButton("movie", "Capture a movie", {
      testid: "toolbar-movie",
      "aria-pressed": "false",
      onclick: () => void actions.toggleMovie(),
    });
    this.#toolbar = el(
      "nav",
      { class: "toolbar float", "aria-label": "Page" },
      iconButton("open", "Open a recording", { testid: "toolbar-open", onclick: chooseFile }),
      iconButton("layers", "Layers (L)", {
        testid: "toolbar-layers",
        onclick: () => actions.togglePart("isLayersOpen"),
      }),
      iconButton("link", "Copy a link to this view", {
        testid: "toolbar-link",
        onclick: () => void actions.copyLink(),
      }),
      iconButton("picture", "Save a picture", {
        testid: "toolbar-picture",
        onclick: () => void actions.savePicture(),
      }),
      this.#movie,
      iconButton("help", "Keys (?)", { testid: "toolbar-help", onclick: openHelp }),
      iconButton("panel", "Panels (P)", {
        testid: "toolbar-panel",
        onclick: () => actions.togglePart("isPanelOpen"),
      }),
    );
    this.#stage = el(
      "main",
      { class: "stage", testid: "stage" },
      canvas,
      this.axes.root,
      this.#welcome.root,
      this.#layers?.root,
      this.#toolbar,
      el("div", { class: "stage-foot" }, this.#camera.root, this.legend.root),
      this.renderStats.root,
      this.#caption,
      this.banners.root,
    );
    const side = el(
      "aside",
      { class: "side", testid: "side", "aria-label": "Run" },
      this.#map.root,
      this.#run.root,
      this.#simulator.root,
      this.#run.facts,
      this.#agent.root,
      this.#agents.root,
      this.#chartCard,
      this.#counters.root,
      this.#scenario.root,
    );
    this.#frame = el("div", { class: "frame" }, this.#stage, side, this.#playbackBar.root, file);
    this.#frame.classList.toggle("is-picture", isPicture);
    root.replaceChildren(this.#frame);
    this.#acceptDrops(actions);
  }

  onResize(resized: (width: number, height: number) => void): void {
    new ResizeObserver(() => resized(this.#stage.clientWidth, this.#stage.clientHeight)).observe(this.#stage);
  }

  /** Reports clicks on the image that are no drags, in its CSS pixels. */
  onPick(picked: (x: number, y: number) => void): void {
    let pressed: { x: number; y: number } | null = null;
    this.#canvas.addEventListener("pointerdown", (event) => {
      pressed = event.button === 0 ? { x: event.clientX, y: event.clientY } : null;
    });
    this.#canvas.addEventListener("pointerup", (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > CLICK_PX) return;
      const box = this.#canvas.getBoundingClientRect();
      picked(event.clientX - box.left, event.clientY - box.top);
    });
  }

  /** Names what is below a mouse that is at rest over the image, in its CSS pixels. */
  onHover(nameAt: (x: number, y: number) => string): void {
    this.#canvas.addEventListener("pointermove", (event) => {
      if (event.pointerType !== "mouse") return;
      const name = event.buttons === 0 ? nameAt(event.offsetX, event.offsetY) : "";
      if (this.#canvas.title !== name) this.#canvas.title = name;
    });
  }

  setParts(isPanelOpen: boolean, isLayersOpen: boolean, areStatsOpen: boolean): void {
    this.#frame.classList.toggle("has-panel", isPanelOpen);
    this.#frame.classList.toggle("has-layers", isLayersOpen);
    this.renderStats.root.hidden = !areStatsOpen;
    const pressed = (testid: string, isPressed: boolean) =>
      this.#toolbar
        .querySelector(`[data-testid="${testid}"]`)
        ?.setAttribute("aria-pressed", String(isPressed));
    pressed("toolbar-layers", isLayersOpen);
    pressed("toolbar-panel", isPanelOpen);
  }

  /** While the first picture is awaited, the panels keep their room, but are not drawn. */
  setOpening(isOpening: boolean): void {
    if (this.#isPicture || isOpening === this.#isOpening) return;
    this.#isOpening = isOpening;
    this.#frame.classList.toggle("is-opening", isOpening);
    if (isOpening) this.#frame.classList.add("has-run");
  }

  setCapturing(isCapturing: boolean): void {
    setIcon(this.#movie, isCapturing ? "stop" : "movie", isCapturing ? "Save the movie" : "Capture a movie");
    this.#movie.setAttribute("aria-pressed", String(isCapturing));
  }

  /** `room`: the tools for a map; null: a run is shown, or nothing. */
  update(
    panel: PanelState | null,
    room: MapRoom | null,
    clock: Clock,
    live: LiveConnection | null,
    busy: string | null,
  ): void {
    this.#frame.classList.toggle("has-run", panel !== null || this.#isOpening);
    this.#frame.classList.toggle("is-map", room !== null);
    this.#stage.classList.toggle("is-picking", room ? room.tool !== "look" : this.#mapEdit.isOn);
    setHidden(this.#welcome.root, panel !== null || this.#isPicture);
    if (!panel) {
      this.#welcome.update(busy, live);
      return;
    }
    this.#sceneName.update(panel, clock.isMoving);
    const { run, timeS, selected } = panel;
    if (this.#isPicture) {
      setText(this.#caption, captionOf(panel));
      return;
    }
    this.#playbackBar.update(panel, clock);
    this.#camera.update(selected, this.#view?.layers.unexplored ?? false);
    if (this.#view) this.#layers?.update(this.#view, selected);
    if (!this.#frame.classList.contains("has-panel")) return;
    this.#map.update(run, room);
    if (room !== null) return;
    this.#run.update(panel);
    this.#simulator.update(live);
    this.#agent.update(panel);
    this.#agents.update(panel);
    if (this.#chartCard.open) this.#chart.update(run, timeS, panel.lineEndS, selected);
    this.#counters.update(panel);
    this.#scenario.update(panel);
  }

  #acceptDrops(actions: PageActions): void {
    const isFile = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    window.addEventListener("dragover", (event) => {
      if (!isFile(event)) return;
      event.preventDefault();
      this.#frame.classList.add("is-dropping");
    });
    window.addEventListener("dragleave", (event) => {
      if (event.relatedTarget === null) this.#frame.classList.remove("is-dropping");
    });
    window.addEventListener("drop", (event) => {
      if (!isFile(event)) return;
      event.preventDefault();
      this.#frame.classList.remove("is-dropping");
      const dropped = event.dataTransfer?.files[0];
      if (dropped) void actions.openFile(dropped);
    });
  }
}
