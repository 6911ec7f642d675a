/**
 * Decides when the next frame may be drawn, and in which quality. Pure: the cost of frames is
 * passed in.
 *
 * The simulator may run on the same cores, and with software rendering a frame can take a quarter
 * of a second of them. So there is a pause between frames, and while things move, expensive frames
 * are drawn in less detail and with fewer pixels.
 */

/** Earliest start of the next frame, as a multiple of the duration of the last one. */
const REST = 1.1;
/** Frames above the first limit are slow, below the second one quick; milliseconds. */
const SLOW_MS = 90;
const QUICK_MS = 22;
/** One frame above this reduces the quality at once. */
const VERY_SLOW_MS = 300;
/** Number of consecutive slow or quick frames that change the quality. */
const SLOW_ROW = 3;
const QUICK_ROW = 40;

/** Quality of a frame. */
export interface Quality {
  /** Share of the full pixel ratio. */
  readonly share: number;
  /** Whether the cave is drawn in less detail. */
  readonly isCoarse: boolean;
}

export const FULL: Quality = { share: 1, isCoarse: false };
const STEPS: readonly Quality[] = [
  FULL,
  ...[1, 0.75, 0.5, 0.375].map((share) => ({ share, isCoarse: true })),
];
/** Without a GPU, full frames can take seconds, and full detail is never fast enough. */
const SOFTWARE = { least: 1, first: 3 };

export class FramePacer {
  readonly #least: number;
  #step: number;
  #slow = 0;
  #quick = 0;
  #notBeforeMs = -Infinity;
  #costMs = 0;

  /** `isSoftware`: frames are rendered by the CPU. */
  constructor(isSoftware = false) {
    this.#least = isSoftware ? SOFTWARE.least : 0;
    this.#step = isSoftware ? SOFTWARE.first : 0;
  }

  /** Quality while things move. */
  get quality(): Quality {
    return STEPS[this.#step]!;
  }

  /** Smoothed cost of a frame, milliseconds. */
  get costMs(): number {
    return this.#costMs;
  }

  mayBegin(nowMs: number): boolean {
    return nowMs >= this.#notBeforeMs;
  }

  /**
   * Reports the start and end of a frame. `counts` is false for frames drawn in another quality.
   */
  done(beganMs: number, doneMs: number, counts: boolean): void {
    const costMs = Math.max(0, doneMs - beganMs);
    this.#notBeforeMs = beganMs + costMs * REST;
    if (!counts) return;
    this.#costMs = this.#costMs === 0 ? costMs : this.#costMs * 0.8 + costMs * 0.2;
    if (costMs > VERY_SLOW_MS) this.#slow = SLOW_ROW;
    else this.#slow = costMs > SLOW_MS ? this.#slow + 1 : 0;
    this.#quick = costMs < QUICK_MS ? this.#quick + 1 : 0;
    if (this.#slow >= SLOW_ROW && this.#step < STEPS.length - 1) this.#change(1);
    else if (this.#quick >= QUICK_ROW && this.#step > this.#least) this.#change(-1);
  }

  #change(steps: number): void {
    this.#step += steps;
    this.#slow = 0;
    this.#quick = 0;
  }
}
