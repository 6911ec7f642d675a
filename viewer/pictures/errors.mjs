/**
 * Errors for people: one line that names the thing and what was expected, without a stack trace.
 */

/** The request is invalid: exit code 2. */
export class InvalidRequest extends Error {
  exitCode = 2;
}

/** The machine, a program or the page has failed: exit code 1. */
export class CaptureError extends Error {
  exitCode = 1;
}

/**
 * The first line of an error, without the name of the call: Playwright adds logs and advice.
 * @param {unknown} thrown
 * @returns {string}
 */
export function firstLine(thrown) {
  const text = thrown instanceof Error ? thrown.message : String(thrown);
  const line = text.trim().split("\n", 1)[0] ?? "";
  return line.replace(/^\w+\.\w+: (?=\S)/, "");
}
