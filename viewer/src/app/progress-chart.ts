/**
 * Chart of the explored and covered shares over time, with a cursor at the time shown. A click
 * seeks.
 */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Run } from "../data/run.ts";
import { agentColour } from "../scene/colours.ts";
import { labels, shareOf } from "./timeline-axis.ts";
import { el, setHidden } from "./dom.ts";
import { clockTime } from "./format.ts";
import { progressColumns } from "./panel-state.ts";

/** A colour of the page in the present scheme, read whenever the chart is drawn. */
const colour =
  (name: string) =>
  (plot: uPlot): string => {
    probe.style.color = `var(${name})`;
    plot.root.append(probe);
    const shown = getComputedStyle(probe).color;
    probe.remove();
    return shown;
  };
const probe = el("span", {});

const WIDTH = 288;
const HEIGHT = 156;
const GRID = "rgb(140 160 190 / 16%)";

export class ProgressChart {
  readonly root: HTMLElement;
  readonly #container = el("div", { class: "chart", testid: "chart" });
  readonly #empty = el(
    "p",
    { class: "quiet" },
    "No progress yet; the server publishes it every 10 s of sim time.",
  );
  readonly #cursor = el("div", { class: "chart-cursor" });
  readonly #seek: (timeS: number) => void;
  #plot: uPlot | null = null;
  #run: Run | null = null;
  #points = -1;
  #endS = 0;
  #selected: number | null = null;

  constructor(seek: (timeS: number) => void) {
    this.#seek = seek;
    matchMedia("(prefers-color-scheme: light)").addEventListener("change", () => this.#plot?.redraw(false));
    const key = el(
      "div",
      { class: "chart-key" },
      el("span", { class: "key key-explored" }, "explored"),
      el("span", { class: "key key-covered" }, "covered"),
      el("span", { class: "key key-agents" }, "explored by each agent"),
    );
    this.root = el("div", {}, this.#container, this.#empty, key);
  }

  /** `endS`: the end of the axis of time. */
  update(run: Run, timeS: number, endS: number, selected: number | null): void {
    if (run !== this.#run) this.#open(run);
    const plot = this.#plot!;
    const points = run.progress.length + (run.result ? 1 : 0);
    if (points !== this.#points || endS !== this.#endS) {
      this.#points = points;
      this.#endS = endS;
      plot.setData(progressColumns(run) as uPlot.AlignedData);
      setHidden(this.#empty, points > 0);
      setHidden(this.#container, points === 0);
    }
    if (selected !== this.#selected) {
      this.#selected = selected;
      plot.redraw(false);
    }
    this.#cursor.style.left = `${shareOf(timeS, endS) * 100}%`;
  }

  #open(run: Run): void {
    this.#plot?.destroy();
    this.#run = run;
    this.#points = -1;
    const axis = {
      stroke: colour("--text-quiet"),
      font: "11px system-ui, sans-serif",
      ticks: { show: false },
      gap: 4,
    };
    const agents = Array.from({ length: run.setup.agents }, (_, agent) => this.#agentSeries(agent));
    this.#plot = new uPlot(
      {
        width: WIDTH,
        height: HEIGHT,
        padding: [8, 16, 0, 0],
        legend: { show: false },
        cursor: { drag: { x: false, y: false }, points: { show: false }, y: false },
        scales: { x: { time: false, range: () => [0, this.#endS || 1] }, y: { range: [0, 1] } },
        axes: [
          {
            ...axis,
            size: 22,
            grid: { stroke: GRID, width: 1 },
            splits: () => labels(this.#endS || 1, 5),
            values: (_, times) => times.map(clockTime),
          },
          {
            ...axis,
            size: 40,
            grid: { stroke: GRID, width: 1 },
            splits: () => [0, 0.25, 0.5, 0.75, 1],
            values: (_, shares) => shares.map((share) => `${share * 100} %`),
          },
        ],
        series: [
          {},
          {
            stroke: colour("--explored"),
            width: 2,
            fill: "rgb(240 194 122 / 10%)",
            points: { show: false },
          },
          { stroke: colour("--covered"), width: 2, points: { show: false } },
          ...agents,
        ],
      },
      [[], [], []],
      this.#container,
    );
    this.#plot.over.append(this.#cursor);
    this.#plot.over.addEventListener("click", (event) => {
      const box = this.#plot!.over.getBoundingClientRect();
      this.#seek(this.#plot!.posToVal(event.clientX - box.left, "x"));
    });
  }

  #agentSeries(agent: number): uPlot.Series {
    const isFaint = () => this.#selected !== null && this.#selected !== agent;
    return {
      stroke: () => agentColour(agent) + (isFaint() ? "40" : "b0"),
      width: 1,
      points: { show: false },
    };
  }
}
