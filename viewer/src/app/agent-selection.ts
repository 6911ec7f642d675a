/** Selecting an agent by buttons and digit keys. Pure. */

/** The agent that the bar's buttons lead to: the cave lies between the last one and the first. */
export function nextSelection(selected: number | null, step: 1 | -1, agents: number): number | null {
  // Place 0 is the cave, and agent n has place n + 1.
  const places = agents + 1;
  const place = ((selected === null ? 0 : selected + 1) + step + places) % places;
  return place === 0 ? null : place - 1;
}

/** How long a second digit may take, milliseconds. */
const DIGITS_MS = 600;

/** Digits that are typed become the number of an agent; two of them one number if they come quickly and there is such an agent. */
export class AgentNumberInput {
  #last: { digit: number; atMs: number } | null = null;

  /** The agent that is meant now; null: there is none of that number. */
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
