/**
 * When the next picture may be drawn, and how fine. Pure: it is told what pictures have cost.
 *
 * The simulator may run on the same cores, and with software rendering a picture can cost a quarter of a second of them. So a
 * picture begins a little later than the last one is done, and pictures that cost much are drawn with fewer pixels while things move.
 */

/** When the next picture may begin, as a multiple of what the last one took. */
const REST = 1.1;
/** Above this a picture counts as slow, below the other as quick; milliseconds. */
const SLOW_MS = 90;
const QUICK_MS = 22;
/** One of these is enough. */
const VERY_SLOW_MS = 300;
/** So many slow or quick pictures in a row change the number of pixels. */
const SLOW_ROW = 3;
const QUICK_ROW = 40;
/** Shares of the full pixel ratio. */
const SHARES = [1, 0.75, 0.5, 0.375];

export class Pacer {
  #step: number;
  #slow = 0;
  #quick = 0;
  #notBeforeMs = -Infinity;
  #costMs = 0;

  /** `isSoftware`: without a graphics card, pictures begin with half the pixels, because one with all of them can take seconds. */
  constructor(isSoftware = false) {
    this.#step = isSoftware ? 2 : 0;
  }

  /** Share of the full pixel ratio to draw with while things move. */
  get share(): number {
    return SHARES[this.#step]!;
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
    if (this.#slow >= SLOW_ROW && this.#step < SHARES.length - 1) this.#change(1);
    else if (this.#quick >= QUICK_ROW && this.#step > 0) this.#change(-1);
  }

  #change(steps: number): void {
    this.#step += steps;
    this.#slow = 0;
    this.#quick = 0;
  }
}
