/**
 * When the next picture may be drawn, and how fine. Pure: it is told what pictures have cost.
 *
 * The simulator may run on the same cores, and with software rendering a picture can cost a quarter of a second of them. So a
 * picture begins a little later than the last one is done, and pictures that cost much are drawn in less detail and with fewer pixels
 * while things move.
 */

/** When the next picture may begin, as a multiple of what the last one took. */
const REST = 1.1;
/** Above this a picture counts as slow, below the other as quick; milliseconds. */
const SLOW_MS = 90;
const QUICK_MS = 22;
/** One of these is enough. */
const VERY_SLOW_MS = 300;
/** So many slow or quick pictures in a row change how fine they are. */
const SLOW_ROW = 3;
const QUICK_ROW = 40;

/** How fine a picture is. */
export interface Quality {
  /** Of the full pixel ratio. */
  readonly share: number;
  /** Whether the cave is drawn in less detail. */
  readonly isCoarse: boolean;
}

export const FULL: Quality = { share: 1, isCoarse: false };
const STEPS: readonly Quality[] = [
  FULL,
  ...[1, 0.75, 0.5, 0.375].map((share) => ({ share, isCoarse: true })),
];
/** Without a graphics card, pictures with all pixels can take seconds, and those in full detail are never quick enough. */
const SOFTWARE = { least: 1, first: 3 };

export class FramePacer {
  readonly #least: number;
  #step: number;
  #slow = 0;
  #quick = 0;
  #notBeforeMs = -Infinity;
  #costMs = 0;

  /** `isSoftware`: there is no graphics card. */
  constructor(isSoftware = false) {
    this.#least = isSoftware ? SOFTWARE.least : 0;
    this.#step = isSoftware ? SOFTWARE.first : 0;
  }

  /** How fine to draw while things move. */
  get quality(): Quality {
    return STEPS[this.#step]!;
  }

  /** What the last picture cost, smoothed; milliseconds. */
  get costMs(): number {
    return this.#costMs;
  }

  mayBegin(nowMs: number): boolean {
    return nowMs >= this.#notBeforeMs;
  }

  /** A picture was begun and done at these moments. `counts` is false for one that was drawn finer than others. */
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
