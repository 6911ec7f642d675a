/** The state of a run as a short text. Pure. */
import type { Run } from "../data/run.ts";
import type { LiveConnection } from "./live.ts";
import { STATE } from "./services.ts";

export interface StateText {
  readonly text: string;
  /** Determines the colour. */
  readonly kind: "recording" | "running" | "held" | "over" | "trouble";
}

type LiveState = Pick<LiveConnection, "state" | "hasEnded" | "simulationState">;

/** The state of a run, as the server reports it for live ones. */
export function stateOf(run: Pick<Run, "isComplete" | "result">, live: LiveState | null): StateText {
  if (!live) {
    return run.isComplete ? { text: "recording", kind: "recording" } : { text: "reading", kind: "held" };
  }
  if (live.hasEnded || run.result) return { text: "ended", kind: "over" };
  if (live.state === "lost" || live.state === "connecting")
    return { text: "connection lost", kind: "trouble" };
  if (live.state === "closed") return { text: "disconnected", kind: "over" };
  switch (live.simulationState) {
    // Stopped: paused before the first tick.
    case STATE.stopped:
    case STATE.paused:
      return { text: "paused", kind: "held" };
    case STATE.quitting:
      return { text: "quitting", kind: "over" };
    case STATE.playing:
      return { text: "playing", kind: "running" };
    default:
      return { text: "live", kind: "running" };
  }
}
