/** Marks on a map: the measured points with the line between them, and the starts of agents. */

import type { Group } from "three";
import type { Vec3 } from "../data/run.ts";
import { agentRgb } from "./colours.ts";
import type { SharedUniforms } from "./glsl.ts";
import { MARKER, Markers, type Marker } from "./markers.ts";
import { Segments } from "./ribbons.ts";

export interface Marks {
  /** Up to two points, metres. */
  readonly measured: readonly Vec3[];
  /** Metres, by agent. */
  readonly starts: readonly Vec3[];
}

const MEASURED: Marker["colour"] = [1, 0.9, 0.35];

export class MapMarks {
  readonly #line: Segments;
  readonly #points: Markers;

  constructor(common: SharedUniforms, root: Group) {
    // The line is seen through walls, as the points are.
    this.#line = new Segments(common, 1, 8);
    this.#points = new Markers(common, 0);
    root.add(...this.#line.meshes, this.#points.mesh);
    this.show({ measured: [], starts: [] });
  }

  show({ measured, starts }: Marks): void {
    const [from, to] = measured;
    const line = { colour: MEASURED, alpha: 0.9, widthPx: 2, dashM: 0 };
    this.#line.show(from === undefined || to === undefined ? [] : [{ from, to, ...line }]);
    const shape = { abovePx: 0, alpha: 1, number: 0 };
    this.#points.show([
      ...measured.map((anchor) => ({
        ...shape,
        kind: MARKER.target,
        anchor,
        radiusPx: 9,
        colour: MEASURED,
      })),
      ...starts.flatMap((anchor, agent) => {
        const colour = agentRgb(agent);
        return [
          { ...shape, kind: MARKER.ring, anchor, radiusPx: 11, colour },
          { ...shape, kind: MARKER.dot, anchor, radiusPx: 5, colour },
        ];
      }),
    ]);
  }

  dispose(): void {
    this.#line.dispose();
    this.#points.dispose();
  }
}
