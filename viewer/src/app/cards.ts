/** The run cards of the side panel: setup and progress, counters, scenario. */
import type { Run } from "../data/run.ts";
import { el, fill, setHidden, setText } from "./dom.ts";
import { clockTime, count, finePercent, metres, speedFactor, percent, words } from "./format.ts";
import { sharesAt, teamOf } from "./panel-state.ts";
import type { PanelState } from "./panel-state.ts";
import { stateOf } from "./state-text.ts";

/** A collapsible card with a heading. */
export function card(
  title: string,
  testid: string,
  isOpen: boolean,
  ...content: HTMLElement[]
): HTMLDetailsElement {
  return el(
    "details",
    { class: "card", testid, open: isOpen },
    el("summary", {}, title),
    el("div", { class: "card-body" }, ...content),
  );
}

/** A list of names and values; a row without a value is hidden. */
export class FactList {
  readonly root = el("dl", { class: "facts" });
  readonly #rows = new Map<string, { name: HTMLElement; value: HTMLElement }>();

  set(name: string, value: string | null, title?: string): void {
    let row = this.#rows.get(name);
    if (!row) {
      if (value === null) return;
      const testid = `fact-${name.toLowerCase().replace(/[^a-z]+/g, "-")}`;
      row = { name: el("dt", {}, name), value: el("dd", { testid }) };
      this.#rows.set(name, row);
      this.root.append(row.name, row.value);
    }
    setHidden(row.name, value === null);
    setHidden(row.value, value === null);
    if (value !== null) setText(row.value, value);
    if (title !== undefined) row.value.title = title;
  }
}

/** Title, state, progress and setup of the run. */
export class RunCard {
  readonly root: HTMLElement;
  /** What is known of the run: more in its course, so that what has to keep its place is above. */
  readonly facts: HTMLElement;
  readonly #title = el("h1", { class: "run-title", testid: "run-title" });
  readonly #state = el("span", { class: "chip", testid: "run-state" });
  readonly #bar = el("div", { class: "progress-bar" });
  readonly #barText = el("span", { class: "progress-text", testid: "progress-text" });
  readonly #progress = el(
    "div",
    {
      class: "progress",
      role: "progressbar",
      "aria-label": "Explored",
      "aria-valuemin": 0,
      "aria-valuemax": 100,
    },
    this.#bar,
    this.#barText,
  );
  readonly #explored = el("span", { class: "figure-value", testid: "explored" });
  readonly #covered = el("span", { class: "figure-value", testid: "covered" });
  readonly #facts = new FactList();

  constructor() {
    const figure = (name: string, value: HTMLElement, kind: string) =>
      el("div", { class: `figure figure-${kind}` }, value, el("span", { class: "figure-name" }, name));
    this.root = el(
      "section",
      { class: "card run-card", testid: "run-card" },
      el("div", { class: "run-head" }, this.#title, this.#state),
      this.#progress,
      el(
        "div",
        { class: "figures-row" },
        figure("explored", this.#explored, "explored"),
        figure("covered", this.#covered, "covered"),
      ),
    );
    this.facts = el("section", { class: "card", testid: "facts-card" }, this.#facts.root);
  }

  update(panel: PanelState): void {
    const { run, timeS, live } = panel;
    setText(this.#title, run.title);
    this.#title.title = run.title;
    const state = stateOf(run, live);
    setText(this.#state, state.text);
    this.#state.dataset["kind"] = state.kind;

    const { explored, covered } = sharesAt(run, timeS);
    setText(this.#explored, finePercent(explored));
    setText(this.#covered, finePercent(covered));
    this.#bar.style.width = `${Math.min(1, explored) * 100}%`;
    const end =
      run.result && timeS >= run.result.timeS
        ? `ended at ${clockTime(timeS)}`
        : `${clockTime(run.setup.durationS - timeS)} to the time limit`;
    setText(this.#barText, `${percent(explored)} explored, ${end}`);
    this.#progress.setAttribute("aria-valuenow", String(Math.floor(explored * 100)));

    this.#facts.set("Real-time factor", live && !run.isComplete ? speedFactor(panel.realTimeFactor) : null);
    this.#factsOf(run, timeS);
  }

  #factsOf(run: Run, timeS: number): void {
    const { setup, terrain } = run;
    this.#facts.set("Agents", `${setup.agents}, ${teamOf(setup.controllers)}`);
    const cell = terrain.cellM === 1 ? "" : `, ${terrain.cellM} m each`;
    this.#facts.set("Map", `${terrain.size.join(" x ")} cells${cell}`);
    this.#facts.set("Free cells", count(terrain.freeCells));
    this.#facts.set("Seed", setup.seed);
    this.#facts.set("Duration", clockTime(setup.durationS));
    this.#facts.set("LiDAR", lidarOf(run));
    this.#facts.set(
      "Radio range",
      setup.communicationRangeM === Infinity ? null : metres(setup.communicationRangeM),
    );
    const result = run.result && timeS >= run.result.timeS ? run.result : null;
    this.#facts.set("Ended", result && `${result.reason}, at ${clockTime(result.timeS)}`);
    this.#facts.set("Digest", result && `${result.digest.slice(0, 16)}...`, result?.digest ?? "");
  }
}

function lidarOf(run: Run): string {
  const { rays, rangeM, fovRad } = run.setup.lidar;
  const parts = [rays === 0 ? "shell" : `${count(rays)} rays`];
  if (rangeM !== Infinity) parts.push(metres(rangeM));
  if (fovRad < 2 * Math.PI - 1e-9) parts.push(`${Math.round((fovRad * 180) / Math.PI)}°`);
  return parts.join(", ");
}

/** The counters of the result; hidden until there is one. */
export class CountersCard {
  readonly #body = el("tbody", { testid: "counters" });
  readonly root = card("Counters", "counters-card", false, el("table", { class: "numbers" }, this.#body));
  #shown: Run["result"] = null;

  constructor() {
    this.root.hidden = true;
  }

  update({ run }: PanelState): void {
    if (run.result === this.#shown) return;
    this.#shown = run.result;
    setHidden(this.root, run.result === null);
    const rows = [...(run.result?.counters ?? [])].map(([name, value]) =>
      el("tr", {}, el("th", { scope: "row" }, words(name)), el("td", {}, count(value))),
    );
    fill(this.#body, ...rows);
  }
}

/** The scenario, TOML. */
export class ScenarioCard {
  readonly #text = el("pre", { class: "scenario", tabindex: 0, testid: "scenario" });
  readonly root = card("Scenario", "scenario-card", false, this.#text);

  update({ run }: PanelState): void {
    setText(this.#text, run.setup.scenarioToml);
  }
}
