/**
 * The time that is shown: played at a rate, held, or following a run under way.
 *
 * Following means to show where the end of the run was a moment ago, straight between what was known then: news come in lumps, and
 * the picture is to move evenly. The clock never shows what is not known yet. Pure: the time on the wall is told to it.
 */

/** How far behind the end of a run the picture is, seconds on the wall. */
export const FOLLOW_LAG_S = 0.25;

/** Over how long the pace of a run is measured, seconds on the wall. */
const RATE_WINDOW_S = 3;

/** RunUpdate that are farther apart than this do not come from a run that grows evenly, seconds on the wall. */
const BURST_S = 0.2;

/** A picture that took longer than this was none: the page was hidden. */
const STEP_MAX_S = 1;

interface Sample {
  readonly wallS: number;
  readonly endS: number;
}

export class Clock {
  timeS = 0;
  isPlaying = false;
  /** Sim seconds for each second on the wall while playing. */
  rate = 10;
  /** Whether the end of the run is followed. */
  isFollowing = false;
  #wallS: number | null = null;
  #samples: Sample[] = [];

  /** Another run is looked at. */
  reset(): void {
    this.timeS = 0;
    this.isPlaying = false;
    this.isFollowing = false;
    this.#wallS = null;
    this.#samples = [];
  }

  /** Holds the picture at a time. */
  seek(timeS: number, endS: number): void {
    this.isFollowing = false;
    this.timeS = Math.min(Math.max(0, timeS), endS);
  }

  /** Plays from here, or from the beginning if this is the end of a run that is over. */
  play(endS: number, isComplete: boolean): void {
    this.isPlaying = true;
    if (isComplete && this.timeS >= endS) this.timeS = 0;
  }

  follow(): void {
    this.isFollowing = true;
    this.isPlaying = false;
  }

  /** Goes on to a moment on the wall. `isLive` says whether what is known grows as the run goes on. */
  advance(wallS: number, endS: number, isComplete: boolean, isLive: boolean): void {
    const stepS = this.#wallS === null ? 0 : Math.min(STEP_MAX_S, Math.max(0, wallS - this.#wallS));
    this.#wallS = wallS;
    this.#recordSample(wallS, endS);
    if (this.isFollowing) {
      this.timeS = Math.min(endS, Math.max(this.#endAt(wallS - FOLLOW_LAG_S), 0));
      return;
    }
    if (!this.isPlaying) return;
    this.timeS += stepS * this.rate;
    if (this.timeS < endS) return;
    this.timeS = endS;
    if (isComplete) this.isPlaying = false;
    else if (isLive) this.follow();
  }

  /** Whether the time shown will be another one soon, though nobody does anything. */
  get isMoving(): boolean {
    if (this.isPlaying) return true;
    const last = this.#samples.at(-1);
    return this.isFollowing && last !== undefined && this.timeS < last.endS;
  }

  /** Sim seconds for each second on the wall in which the run has grown lately. */
  get realTimeFactor(): number {
    const [first, last] = [this.#samples[0], this.#samples.at(-1)];
    if (!first || !last || this.#wallS === null) return 0;
    const fromS = Math.max(first.wallS, this.#wallS - RATE_WINDOW_S);
    const spanS = this.#wallS - fromS;
    return spanS < 0.2 ? 0 : (last.endS - this.#endAt(fromS)) / spanS;
  }

  /** Keeps the moments at which more became known. */
  #recordSample(wallS: number, endS: number): void {
    const last = this.#samples.at(-1);
    if (last && (endS === last.endS || wallS <= last.wallS)) return;
    // After a rest the run did not begin to grow at the time of the last news.
    if (last && wallS - last.wallS > BURST_S) this.#samples.push({ wallS: wallS - BURST_S, endS: last.endS });
    this.#samples.push({ wallS, endS });
    while (this.#samples.length > 2 && this.#samples[1]!.wallS < wallS - RATE_WINDOW_S) this.#samples.shift();
  }

  #endAt(wallS: number): number {
    const later = this.#samples.findIndex((sample) => sample.wallS > wallS);
    if (later < 0) return this.#samples.at(-1)?.endS ?? 0;
    const after = this.#samples[later]!;
    const before = this.#samples[later - 1];
    if (!before) return after.endS;
    const share = (wallS - before.wallS) / (after.wallS - before.wallS);
    return before.endS + share * (after.endS - before.endS);
  }
}
