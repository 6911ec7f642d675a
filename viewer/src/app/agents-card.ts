/** The agent cards of the side panel: a table of all agents, or the details of the selected one. */
import type { AgentState, Progress, Run } from "../data/run.ts";
import { agentColour } from "../scene/colours.ts";
import { FactList } from "./cards.ts";
import { el, fill, iconButton, setHidden, setText } from "./dom.ts";
import { bytes, clockTime, count, finePercent, heading, metres, percent, positionText } from "./format.ts";
import { nameOf, progressAt } from "./panel-state.ts";
import type { PanelState } from "./panel-state.ts";

/** Progress is published every 10 s; progress of the same tick counts as current. */
const FRESH_S = 0.05;

/** Note on the age of progress values; null if they are current. */
function ageOf(progress: Progress | null, timeS: number): string | null {
  if (!progress) return "not reported yet";
  return timeS - progress.timeS > FRESH_S ? `as of ${clockTime(progress.timeS)}` : null;
}

function swatch(agent: number): HTMLElement {
  return el("span", { class: "swatch", style: `--agent: ${agentColour(agent)}` });
}

function taskOf(agent: AgentState): string {
  const task =
    agent.task === "path" ? "following a path" : agent.task === "move" ? "moving straight" : agent.task;
  return agent.collision === "none" ? task : `${task}, collision with ${agent.collision}`;
}

interface Row {
  readonly root: HTMLTableRowElement;
  readonly task: HTMLElement;
  readonly explored: HTMLElement;
  readonly distance: HTMLElement;
}

/** The table of agents; a click selects one. */
export class AgentsCard {
  readonly root: HTMLElement;
  readonly #body = el("tbody", { testid: "agents" });
  readonly #note = el("span", { class: "note" });
  readonly #select: (agent: number) => void;
  #run: Run | null = null;
  #rows: Row[] = [];

  constructor(select: (agent: number) => void) {
    this.#select = select;
    const head = ["Agent", "Task", "Explored", "Distance"].map((name) => el("th", { scope: "col" }, name));
    this.root = el(
      "section",
      { class: "card", testid: "agents-card" },
      el("h2", { class: "card-title" }, "Agents", this.#note),
      el(
        "div",
        { class: "table-box" },
        el("table", { class: "numbers agents" }, el("thead", {}, el("tr", {}, ...head)), this.#body),
      ),
    );
  }

  update({ run, timeS, selected }: PanelState): void {
    setHidden(this.root, selected !== null);
    if (selected !== null) return;
    if (run !== this.#run) this.#open(run);
    const progress = progressAt(run, timeS);
    setText(this.#note, ageOf(progress, timeS) ?? "");
    this.#rows.forEach((row, agent) => {
      setText(row.task, taskOf(run.agentAt(agent, timeS)));
      setText(row.explored, progress ? percent(progress.exploredBy[agent] ?? NaN) : "");
      setText(row.distance, progress ? metres(progress.distanceM[agent] ?? NaN) : "");
    });
  }

  #open(run: Run): void {
    this.#run = run;
    this.#rows = Array.from({ length: run.setup.agents }, (_, agent) => {
      const controller = nameOf(run.setup.controllers[agent] ?? "");
      const pick = el(
        "button",
        {
          type: "button",
          class: "row-button",
          testid: `agent-row-${agent}`,
          title: `Select agent ${agent}`,
          "aria-label": `agent ${agent}, ${controller}`,
        },
        swatch(agent),
        `${agent} `,
        el("span", { class: "quiet" }, controller),
      );
      const [task, explored, distance] = [
        el("td"),
        el("td", { class: "number" }),
        el("td", { class: "number" }),
      ];
      const root = el(
        "tr",
        { onclick: () => this.#select(agent) },
        el("td", {}, pick),
        task,
        explored,
        distance,
      );
      return { root, task, explored, distance };
    });
    fill(this.#body, ...this.#rows.map((row) => row.root));
  }
}

/** The details of the selected agent. */
export class AgentCard {
  readonly root: HTMLElement;
  readonly #title = el("h2", { class: "card-title", testid: "agent-title" });
  readonly #info = el("p", { class: "agent-info", testid: "agent-info" });
  readonly #facts = new FactList();
  readonly #progressFacts = new FactList();
  readonly #note = el("p", { class: "note" });
  #shown: number | null = null;

  constructor(deselect: () => void) {
    const close = iconButton("close", "Back to the whole cave", { testid: "agent-close", onclick: deselect });
    this.root = el(
      "section",
      { class: "card", testid: "agent-card" },
      el("div", { class: "card-head" }, this.#title, close),
      this.#info,
      this.#facts.root,
      this.#progressFacts.root,
      this.#note,
    );
  }

  update({ run, timeS, selected }: PanelState): void {
    setHidden(this.root, selected === null);
    if (selected === null) return;
    const agent = run.agentAt(selected, timeS);
    if (this.#shown !== selected) {
      this.#shown = selected;
      fill(this.#title, swatch(selected), `Agent ${selected}`);
    }
    setText(this.#info, agent.info || "The controller has no status text.");
    this.#info.classList.toggle("quiet", agent.info === "");

    const target = agent.path.at(-1);
    const facts = this.#facts;
    facts.set("Controller", run.setup.controllers[selected] ?? null);
    facts.set("Task", taskOf(agent));
    facts.set("Position", `${positionText(agent.position)} m`);
    facts.set("Heading", heading(agent.yawRad));
    facts.set("Speed", `${agent.speedMS.toFixed(2)} m/s`);
    facts.set("Target", target ? `${positionText(target)} m` : "none");
    facts.set("Contacts", agent.contacts.length === 0 ? "none" : agent.contacts.join(", "));
    facts.set("Sent", `${count(agent.sent.messages)} messages, ${bytes(agent.sent.bytes)}`);
    facts.set("Received", `${count(agent.received.messages)} messages, ${bytes(agent.received.bytes)}`);
    facts.set("Last observation", clockTime(agent.observedS));

    const progress = progressAt(run, timeS);
    const age = ageOf(progress, timeS);
    setHidden(this.#note, age === null);
    setText(this.#note, age ?? "");
    const share = (values: readonly number[] | undefined) => {
      const value = values?.[selected];
      return value === undefined ? null : finePercent(value);
    };
    this.#progressFacts.set("Explored", share(progress?.exploredBy));
    this.#progressFacts.set("Covered", share(progress?.coveredBy));
    this.#progressFacts.set("Known", share(progress?.believedBy));
    const distanceM = progress?.distanceM[selected];
    this.#progressFacts.set("Distance travelled", distanceM === undefined ? null : metres(distanceM));
  }
}
