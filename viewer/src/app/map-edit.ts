/** The box of a change of the map: two corners, by clicks on the image or as numbers. Pure. */
import type { Vec3 } from "../data/run.ts";
import type { SurfaceHit } from "../data/surface-hit.ts";

/** A box, metres: cells with their centres in it change. */
export interface EditBox {
  readonly low: Vec3;
  readonly high: Vec3;
}

export class MapEdit {
  /** Whether a click on the image is a corner. */
  isOn = false;
  /** Up to two corners, metres. */
  corners: readonly Vec3[] = [];
  readonly #changed: () => void;

  constructor(changed: () => void) {
    this.#changed = changed;
  }

  setOn(isOn: boolean): void {
    if (isOn === this.isOn) return;
    this.isOn = isOn;
    this.corners = [];
    this.#changed();
  }

  /** A click on the image; null: beside the map. A third click begins another box. */
  clicked(hit: SurfaceHit | null): void {
    if (!this.isOn || hit === null) return;
    this.corners = this.corners.length === 1 ? [...this.corners, hit.free] : [hit.free];
    this.#changed();
  }

  /** Sets one coordinate of the lower (0) or upper (1) corner of the box. */
  setCoordinate(corner: 0 | 1, axis: number, metres: number): void {
    if (!Number.isFinite(metres)) return;
    const { low, high } = this.box ?? {
      low: this.corners[0] ?? [0, 0, 0],
      high: this.corners[0] ?? [0, 0, 0],
    };
    const corners: [Vec3, Vec3] = [[...low], [...high]];
    corners[corner][axis] = metres;
    this.corners = corners;
    this.#changed();
  }

  /** The box between two corners, whichever they are; null: there are not two. */
  get box(): EditBox | null {
    const [a, b] = this.corners;
    if (a === undefined || b === undefined) return null;
    const each = (of: (x: number, y: number) => number): Vec3 => [
      of(a[0], b[0]),
      of(a[1], b[1]),
      of(a[2], b[2]),
    ];
    return { low: each(Math.min), high: each(Math.max) };
  }
}
