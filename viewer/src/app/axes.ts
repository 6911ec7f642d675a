/**
 * Labels of a map in metres along three edges of its free space: where it lies and how large it is.
 * Drawn over the image, at positions that the camera projects.
 */
import type { Vec3 } from "../data/run.ts";
import { scaleLengthM } from "./legend.ts";

/** A box, metres. */
export interface Box {
  readonly low: Vec3;
  readonly high: Vec3;
}

/** A position on the image in CSS pixels, y downwards. */
export type Projected = readonly [x: number, y: number];

export interface AxisLabel {
  readonly text: string;
  readonly at: Projected;
  /** The tick at its edge; null for the name of an axis. */
  readonly tick: { readonly from: Projected; readonly to: Projected } | null;
}

/** Steps between two ticks along the longest edge. */
const STEPS = 5;
const TICK_PX = 6;
const LABEL_PX = 18;
const NAME_PX = 54;

/**
 * The labels of a box. The axes x and y have theirs along the lower edge that is nearest to the
 * lower end of the image, z along the edge that is farthest to the left.
 */
export function axisLabels(box: Box, project: (point: Vec3) => Projected): AxisLabel[] {
  const { low, high } = box;
  const lengths = high.map((value, axis) => value - low[axis]!);
  const stepM = scaleLengthM(Math.max(...lengths) / STEPS);
  const middle = project(low.map((value, axis) => (value + high[axis]!) / 2) as Vec3);
  const labels: AxisLabel[] = [];
  for (let axis = 0; axis < 3; axis++) {
    const edge = edgeOf(box, axis, project);
    const along = (value: number): Projected => project(withAxis(edge, axis, value));
    const centre = along((low[axis]! + high[axis]!) / 2);
    const outward = outwardOf(along(low[axis]!), along(high[axis]!), centre, middle);
    const beside = ([x, y]: Projected, px: number): Projected => [x + outward[0] * px, y + outward[1] * px];
    const first = Math.ceil(low[axis]! / stepM - 1e-6);
    const last = Math.floor(high[axis]! / stepM + 1e-6);
    for (let step = first; step <= last; step++) {
      const from = along(step * stepM);
      const text = String(Number((step * stepM).toPrecision(6)));
      labels.push({ text, at: beside(from, LABEL_PX), tick: { from, to: beside(from, TICK_PX) } });
    }
    labels.push({ text: `${"xyz"[axis]}, m`, at: beside(centre, NAME_PX), tick: null });
  }
  return labels;
}

function withAxis(point: Vec3, axis: number, value: number): Vec3 {
  const copy: Vec3 = [...point];
  copy[axis] = value;
  return copy;
}

/** A point of the edge along which an axis is labelled. */
function edgeOf({ low, high }: Box, axis: number, project: (point: Vec3) => Projected): Vec3 {
  const [u, v] = [0, 1, 2].filter((other) => other !== axis) as [number, number];
  let best: Vec3 = low;
  let most = -Infinity;
  for (const [pickU, pickV] of [
    [low, low],
    [low, high],
    [high, low],
    [high, high],
  ] as const) {
    const corner = withAxis(withAxis(low, u, pickU[u]!), v, pickV[v]!);
    // Of the axes that lie flat, only the edges of the floor.
    if (axis !== 2 && corner[2] !== low[2]) continue;
    const ends = [low, high].map((end) => project(withAxis(corner, axis, end[axis]!)));
    const score = axis === 2 ? -(ends[0]![0] + ends[1]![0]) : ends[0]![1] + ends[1]![1];
    if (score > most) [best, most] = [corner, score];
  }
  return best;
}

/** The direction across an edge, away from the middle of the box. */
function outwardOf(from: Projected, to: Projected, centre: Projected, middle: Projected): Projected {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy) || 1;
  const across: Projected = [-dy / length, dx / length];
  const side = (centre[0] - middle[0]) * across[0] + (centre[1] - middle[1]) * across[1];
  return side < 0 ? [-across[0], -across[1]] : across;
}

const SVG = "http://www.w3.org/2000/svg";

/** The labels as an overlay of the image. */
export class Axes {
  readonly root: SVGSVGElement = document.createElementNS(SVG, "svg");
  #shown = "";

  constructor() {
    this.root.setAttribute("class", "axes");
    this.root.setAttribute("data-testid", "axes");
    this.root.setAttribute("aria-hidden", "true");
  }

  update(labels: readonly AxisLabel[]): void {
    const key = JSON.stringify(labels);
    if (key === this.#shown) return;
    this.#shown = key;
    this.root.replaceChildren(...labels.flatMap(elementsOf));
  }
}

function elementsOf({ text, at, tick }: AxisLabel): SVGElement[] {
  const label = document.createElementNS(SVG, "text");
  label.setAttribute("x", String(at[0]));
  label.setAttribute("y", String(at[1]));
  label.textContent = text;
  if (tick === null) return [label];
  const line = document.createElementNS(SVG, "line");
  const ends = { x1: tick.from[0], y1: tick.from[1], x2: tick.to[0], y2: tick.to[1] };
  for (const [name, value] of Object.entries(ends)) line.setAttribute(name, String(value));
  return [line, label];
}
