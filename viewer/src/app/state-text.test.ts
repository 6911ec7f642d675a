import { describe, expect, it } from "vitest";
import { stateOf } from "./state-text.ts";

const LIVE = { state: "open", hasEnded: false, simulationState: 1 } as const;
const UNDER_WAY = { isComplete: false, result: null };

describe("the state of a run", () => {
  it("is reported by the server", () => {
    const text = (simulationState: number | null) => stateOf(UNDER_WAY, { ...LIVE, simulationState }).text;
    expect([0, 1, 2, 3, null].map(text)).toEqual(["paused", "playing", "paused", "quitting", "live"]);
  });

  it("shows a lost connection, unless the run is over", () => {
    expect(stateOf(UNDER_WAY, { ...LIVE, state: "lost" }).kind).toBe("trouble");
    expect(stateOf(UNDER_WAY, { ...LIVE, state: "lost", hasEnded: true }).text).toBe("ended");
  });

  it("shows whether a recording has been read completely", () => {
    expect(stateOf(UNDER_WAY, null).text).toBe("reading");
    expect(stateOf({ isComplete: true, result: null }, null).text).toBe("recording");
  });
});
