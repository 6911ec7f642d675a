/** Selecting an agent by buttons and digit keys. Pure. */

/** The selection after a step; the whole cave lies between the last agent and the first. */
export function nextSelection(selected: number | null, step: 1 | -1, agents: number): number | null {
  // Index 0 is the cave, and agent n has index n + 1.
  const positions = agents + 1;
  const index = ((selected === null ? 0 : selected + 1) + step + positions) % positions;
  return index === 0 ? null : index - 1;
}

/** Maximum time between two digits of one number, milliseconds. */
const DIGITS_MS = 600;

/**
 * Parses typed digits as agent numbers; two digits in quick succession are one number if such an
 * agent exists.
 */
export class AgentNumberInput {
  #last: { digit: number; atMs: number } | null = null;

  /** The agent that the digits name; null if there is no such agent. */
  typed(digit: number, atMs: number, agents: number): number | null {
    const before = this.#last;
    this.#last = { digit, atMs };
    if (before && before.digit > 0 && atMs - before.atMs <= DIGITS_MS) {
      const both = before.digit * 10 + digit;
      if (both < agents) {
        this.#last = null;
        return both;
      }
    }
    return digit < agents ? digit : null;
  }
}
