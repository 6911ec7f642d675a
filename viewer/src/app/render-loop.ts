/**
 * Render loop: draws a frame only if it can differ from the last one, in a quality that the machine
 * can sustain (see `frame-pacer.ts`), and a last one in full quality when everything is at rest.
 *
 * The cost of a frame is measured up to the GPU fence, without blocking: with software rendering
 * another process does the work, and the duration of `render` says nothing.
 */
import type { Scene } from "../scene/scene.ts";
import { FULL, FramePacer, type Quality } from "./frame-pacer.ts";

/** Period of polling the GPU fence. */
const POLL_MS = 3;
/** A frame that is not done within this time never will be: the context is lost. */
const LOST_MS = 5000;
/** Everything counts as at rest after this time without a change. */
const REST_MS = 400;

export interface RenderLoopHost {
  /**
   * Advances to a wall time; returns the sim time to show, and whether it changes without user
   * action.
   */
  advance(wallS: number): { timeS: number; isMoving: boolean };
  /** A frame has been drawn, or none was needed. */
  frameDone(wallS: number, isDrawn: boolean): void;
  /** The GPU has finished a frame. */
  frameFinished(isFull: boolean): void;
  /** Drawing a frame failed. */
  failed(error: Error): void;
}

export class RenderLoop {
  readonly pacer: FramePacer;
  readonly #canvas: HTMLCanvasElement;
  readonly #scene: Scene | null;
  readonly #host: RenderLoopHost;
  #isRequested = true;
  #isScheduled = false;
  #isDrawing = false;
  #isHeld = false;
  /**
   * Whether frames are in full quality until the time changes, so that what a script has drawn
   * stays.
   */
  #isExact = false;
  /** Whether the last frame was in full quality. */
  #isFull = false;
  #isHurried = false;
  #changedMs = 0;
  /** In CSS pixels, with the pixels of a frame per CSS pixel; 0: not set yet. */
  #size = { width: 1, height: 1, ratio: 0 };

  constructor(canvas: HTMLCanvasElement, scene: Scene | null, host: RenderLoopHost) {
    this.#canvas = canvas;
    this.#scene = scene;
    this.#host = host;
    this.pacer = new FramePacer(scene?.isSoftware ?? false);
    this.#schedule();
  }

  get pixelRatio(): number {
    return this.#size.ratio;
  }

  /** Requests a frame. */
  request(): void {
    this.#isRequested = true;
    this.#schedule();
  }

  /** Draws a frame if the scene needs one, and has the panels updated in any case. */
  wake(): void {
    this.#schedule();
  }

  /** Draws in full quality as soon as nothing moves, without waiting. */
  hurry(): void {
    this.#isHurried = true;
    this.#schedule();
  }

  resize(width: number, height: number): void {
    this.#size = { width: Math.max(1, width), height: Math.max(1, height), ratio: 0 };
    this.request();
  }

  /** Draws one frame in full quality; resolves when everything it needs has been drawn. */
  async drawExactly(timeS: number): Promise<void> {
    if (!this.#scene) return;
    this.#isHeld = true;
    this.#isExact = true;
    try {
      this.#setRatio(1);
      await this.#scene.settled(timeS);
      await this.#graphicsDone();
      this.#isFull = true;
    } finally {
      this.#isHeld = false;
      this.#isRequested = false;
    }
  }

  #schedule(): void {
    if (this.#isScheduled) return;
    this.#isScheduled = true;
    requestAnimationFrame((nowMs) => {
      this.#isScheduled = false;
      this.#tick(Math.max(nowMs, performance.now()));
    });
  }

  #tick(nowMs: number): void {
    if (this.#isHeld || this.#isDrawing || !this.pacer.mayBegin(nowMs)) {
      this.#schedule();
      return;
    }
    const { timeS, isMoving } = this.#host.advance(nowMs / 1000);
    const isChanged = this.#isRequested || isMoving || (this.#scene?.needsRedraw ?? false);
    this.#isRequested = false;
    if (isMoving) {
      this.#isExact = false;
      this.#isHurried = false;
    }
    if (isChanged) {
      this.#changedMs = nowMs;
      const quality = this.#isExact ? FULL : this.pacer.quality;
      this.#isFull = quality === FULL;
      this.#drawFrame(timeS, nowMs, quality);
    } else if (!this.#isFull && (this.#isHurried || nowMs - this.#changedMs > REST_MS)) {
      this.#isFull = this.#scene?.prepare(timeS) ?? true;
      if (this.#isFull) this.#isHurried = false;
      if (this.#isFull) this.#drawFrame(timeS, nowMs, FULL);
    }
    this.#host.frameDone(nowMs / 1000, isChanged);
    if (isChanged || !this.#isFull) this.#schedule();
  }

  #drawFrame(timeS: number, nowMs: number, quality: Quality): void {
    if (!this.#scene || this.#scene.isBlank) return;
    this.#setRatio(quality.share);
    try {
      this.#scene.render(timeS, quality);
    } catch (error) {
      this.#host.failed(error as Error);
      return;
    }
    this.#isDrawing = true;
    void this.#graphicsDone().then(() => {
      this.#isDrawing = false;
      this.pacer.done(nowMs, performance.now(), quality === this.pacer.quality);
      this.#host.frameFinished(quality === FULL);
    });
  }

  #setRatio(share: number): void {
    const full = Math.min(window.devicePixelRatio || 1, 2);
    const ratio = full * share;
    if (ratio === this.#size.ratio) return;
    this.#size.ratio = ratio;
    this.#scene?.resize(this.#size.width, this.#size.height, full, share);
  }

  #graphicsDone(): Promise<void> {
    const gl = this.#canvas.getContext("webgl2");
    const fence = gl?.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0) ?? null;
    if (!gl || !fence) return Promise.resolve();
    gl.flush();
    const untilMs = performance.now() + LOST_MS;
    return new Promise((resolve) => {
      const poll = () => {
        const isDone = gl.isContextLost() || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
        if (!isDone && performance.now() < untilMs) {
          setTimeout(poll, POLL_MS);
          return;
        }
        gl.deleteSync(fence);
        resolve();
      };
      poll();
    });
  }
}
