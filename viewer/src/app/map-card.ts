/** The card of a map: what a click does, the measured distance, the reach of a body, and starts. */
import { agentColour } from "../scene/colours.ts";
import type { Run } from "../data/run.ts";
import { saveText } from "./captures.ts";
import { FactList } from "./cards.ts";
import { el, fill, setHidden, setText, textButton, toggle } from "./dom.ts";
import { count, finePercent } from "./format.ts";
import { distanceText, type MapRoom, type RoomTool } from "./map-room.ts";

const TOOLS: readonly (readonly [RoomTool, string, string])[] = [
  ["look", "Look", "Clicks do nothing"],
  ["measure", "Measure", "Click two points of walls: their distance"],
  ["start", "Start", "Click where an agent starts: beside the wall, where its body has room"],
];

export class MapCard {
  readonly root: HTMLElement;
  readonly #title = el("h1", { class: "run-title", testid: "map-title" });
  readonly #facts = new FactList();
  readonly #tools = new Map<RoomTool, { readonly input: HTMLInputElement; readonly root: HTMLElement }>();
  readonly #hint = el("p", { class: "note", testid: "room-hint" });
  readonly #distance = el("p", { class: "room-distance", testid: "measured", "aria-live": "polite" });
  readonly #radius = el("input", {
    type: "number",
    min: "0",
    step: "any",
    testid: "room-radius",
    "aria-label": "Radius of a body, m",
  });
  readonly #reach: { root: HTMLElement; input: HTMLInputElement };
  readonly #body: HTMLElement;
  readonly #shares = new FactList();
  readonly #problem = el("div", { class: "form-problems", role: "alert", testid: "room-problem" });
  readonly #starts = el("ol", { class: "room-starts", testid: "room-starts" });
  readonly #scenario = el("pre", { class: "scenario", tabindex: 0, testid: "room-scenario" });
  readonly #output: HTMLElement;
  readonly #text: HTMLElement;
  #room: MapRoom | null = null;
  #shown: unknown = null;

  constructor() {
    const tools = TOOLS.map(([tool, label, title]) => {
      const input = el("input", { type: "radio", name: "room-tool", value: tool, testid: `room-${tool}` });
      input.addEventListener("change", () => this.#room?.setTool(tool));
      const root = el("label", { class: "segment", title }, input, el("span", {}, label));
      this.#tools.set(tool, { input, root });
      return root;
    });
    this.#radius.addEventListener("change", () => {
      if (this.#radius.value !== "") void this.#room?.setRadius(this.#radius.valueAsNumber);
    });
    this.#reach = toggle(
      "Show what a body reaches",
      "room-reach",
      false,
      (isOn) => void this.#room?.showReach(isOn),
    );
    this.#body = el(
      "div",
      { class: "room-body" },
      el("label", { class: "field" }, el("span", {}, "Radius of a body, m"), this.#radius),
      this.#reach.root,
      this.#shares.root,
      this.#problem,
    );
    this.#text = el(
      "div",
      { class: "room-output" },
      this.#scenario,
      el(
        "div",
        { class: "row" },
        textButton("Copy the scenario", { testid: "room-copy", onclick: () => void this.#copy() }),
        textButton("Download it", { testid: "room-download", onclick: () => this.#download() }),
      ),
    );
    this.#output = el("div", { class: "room-output" }, this.#starts, this.#text);
    this.root = el(
      "section",
      { class: "card map-card", testid: "map-card" },
      this.#title,
      this.#facts.root,
      el("fieldset", { class: "segments" }, el("legend", {}, "A click"), ...tools),
      this.#hint,
      this.#distance,
      this.#body,
      this.#output,
    );
    this.root.hidden = true;
  }

  /** `room`: null where the run is no map. */
  update(run: Run, room: MapRoom | null): void {
    setHidden(this.root, room === null);
    this.#room = room;
    if (room === null) return;
    const { size, cellM, freeCells, walls } = run.terrain;
    setText(this.#title, run.title.replace(/\.m3dm$/i, ""));
    this.#facts.set("Size", size.map((cells) => `${Number((cells * cellM).toFixed(3))}`).join(" x ") + " m");
    this.#facts.set("Cells", `${size.join(" x ")} of ${cellM} m`);
    this.#facts.set("Free", `${count(freeCells)} (${finePercent(freeCells / walls.length)})`);
    for (const [tool, { input, root }] of this.#tools) {
      input.checked = tool === room.tool;
      setHidden(root, tool === "start" && !room.canAsk);
    }
    setText(this.#hint, room.tool === "look" ? "" : TOOLS.find(([tool]) => tool === room.tool)![2]);
    setHidden(this.#hint, room.tool === "look");
    setText(this.#distance, distanceText(room.measured) ?? "");
    setHidden(this.#body, !room.canAsk);
    if (document.activeElement !== this.#radius) this.#radius.value = String(room.radiusM);
    this.#reach.input.checked = room.isReachShown;
    const { answer } = room;
    this.#shares.set("A body fits in", answer && `${finePercent(answer.fits)} of the free cells`);
    const from = answer?.starts.length ? "from its starts" : "in the largest part";
    this.#shares.set("It reaches", answer && `${finePercent(answer.reached)}, ${from}`);
    setText(this.#problem, room.problem ?? "");
    setHidden(this.#problem, room.problem === null);
    this.root.setAttribute("aria-busy", String(room.isAsking));
    setHidden(this.#output, room.starts.length === 0);
    if (answer === this.#shown) return;
    this.#shown = answer;
    setText(this.#scenario, answer?.scenario ?? "");
    setHidden(this.#text, !answer?.scenario);
    fill(
      this.#starts,
      ...room.starts.map((start, index) => {
        const place = start.map((value) => value.toFixed(2)).join(", ");
        const swatch = el("span", { class: "swatch" });
        swatch.style.background = agentColour(index);
        const remove = textButton("Remove", {
          "aria-label": `Remove start ${index}`,
          onclick: () => void room.removeStart(index),
        });
        return el("li", {}, swatch, el("span", {}, `${index}: ${place}`), remove);
      }),
    );
  }

  async #copy(): Promise<void> {
    const text = this.#scenario.textContent ?? "";
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // Not every page may write to the clipboard: the text is there to be selected.
      getSelection()?.selectAllChildren(this.#scenario);
    }
  }

  #download(): void {
    const stem = (this.#title.textContent ?? "").replace(/\.[^.]*$/, "").replace(/[^A-Za-z0-9._-]+/g, "-");
    saveText(`${stem || "map"}.toml`, this.#scenario.textContent ?? "");
  }
}
