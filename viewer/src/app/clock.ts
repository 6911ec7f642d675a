/**
 * The playback clock: the time shown is played at a rate, paused, or follows a live run.
 *
 * Following shows the end of the run with a fixed lag, interpolated between the updates, which
 * arrive in bursts, so that the motion is smooth. The clock never exceeds the known end. Pure: wall
 * time is passed in.
 */

/** Lag behind the end of a live run, seconds of wall time. */
export const FOLLOW_LAG_S = 0.25;

/** Window in which the real-time factor is measured, seconds of wall time. */
const RATE_WINDOW_S = 3;

/** Updates farther apart than this end a pause rather than a steady run, seconds of wall time. */
const BURST_S = 0.2;

/** Longest time step, seconds; a longer one means that the page was hidden. */
const STEP_MAX_S = 1;

interface Sample {
  readonly wallS: number;
  readonly endS: number;
}

export class Clock {
  timeS = 0;
  isPlaying = false;
  /** Playback rate, sim seconds per second of wall time. */
  rate = 10;
  /** Whether the end of a live run is followed. */
  isFollowing = false;
  /** Time to show as soon as it is known; null: that which is shown. */
  #awaitedS: number | null = null;
  /** Time that was sought beyond the end of a complete run, which a longer run beside it has. */
  #beyondS: number | null = null;
  #wallS: number | null = null;
  #samples: Sample[] = [];

  /** Starts over for another run. */
  reset(): void {
    this.timeS = 0;
    this.isPlaying = false;
    this.isFollowing = false;
    this.#awaitedS = null;
    this.#beyondS = null;
    this.#wallS = null;
    this.#samples = [];
  }

  get isAwaiting(): boolean {
    return this.#awaitedS !== null;
  }

  /** The time shown, awaited, or sought beyond the end. */
  get wantedS(): number {
    return this.#awaitedS ?? this.#beyondS ?? this.timeS;
  }

  /**
   * Sets the time and ends following. `isGrowing`: a time beyond the known end is awaited, because a
   * recording is still being read.
   */
  seek(timeS: number, endS: number, isGrowing = false): void {
    this.isFollowing = false;
    this.timeS = Math.min(Math.max(0, timeS), endS);
    this.#awaitedS = isGrowing && timeS > endS ? timeS : null;
    this.#beyondS = !isGrowing && timeS > endS && Number.isFinite(timeS) ? timeS : null;
  }

  /** Plays from the present time, or from the start if that is the end of a complete run. */
  play(endS: number, isComplete: boolean): void {
    this.isPlaying = true;
    this.#beyondS = null;
    if (isComplete && this.timeS >= endS) this.timeS = 0;
  }

  follow(): void {
    this.#awaitedS = null;
    this.#beyondS = null;
    this.isFollowing = true;
    this.isPlaying = false;
  }

  /**
   * Advances to a wall time. `isLive`: the run is live, so that reaching its end means following
   * it.
   */
  advance(wallS: number, endS: number, isComplete: boolean, isLive: boolean): void {
    const stepS = this.#wallS === null ? 0 : Math.min(STEP_MAX_S, Math.max(0, wallS - this.#wallS));
    this.#wallS = wallS;
    this.#recordSample(wallS, endS);
    if (this.isFollowing) {
      this.timeS = Math.min(endS, Math.max(this.#endAt(wallS - FOLLOW_LAG_S), 0));
      return;
    }
    if (this.#awaitedS !== null) {
      this.timeS = Math.min(this.#awaitedS, endS);
      if (this.#awaitedS <= endS || isComplete) this.#awaitedS = null;
      return;
    }
    if (!this.isPlaying) return;
    this.timeS += stepS * this.rate;
    if (this.timeS < endS) return;
    this.timeS = endS;
    if (isComplete) this.isPlaying = false;
    else if (isLive) this.follow();
  }

  /** Whether the time changes without user action. */
  get isMoving(): boolean {
    if (this.isPlaying) return true;
    const last = this.#samples.at(-1);
    return this.isFollowing && last !== undefined && this.timeS < last.endS;
  }

  /** Measured real-time factor of a live run: sim seconds per second of wall time. */
  get realTimeFactor(): number {
    const [first, last] = [this.#samples[0], this.#samples.at(-1)];
    if (!first || !last || this.#wallS === null) return 0;
    const fromS = Math.max(first.wallS, this.#wallS - RATE_WINDOW_S);
    const spanS = this.#wallS - fromS;
    return spanS < 0.2 ? 0 : (last.endS - this.#endAt(fromS)) / spanS;
  }

  /** Keeps the wall times at which the end of the run grew. */
  #recordSample(wallS: number, endS: number): void {
    const last = this.#samples.at(-1);
    if (last && (endS === last.endS || wallS <= last.wallS)) return;
    // After a pause the growth did not begin at the previous update.
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
