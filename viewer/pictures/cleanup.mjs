/**
 * Removes incomplete files and kills child processes whenever this process ends, short of SIGKILL.
 * (Playwright does the same for the browser.)
 */
import { rmSync } from "node:fs";
import process from "node:process";

/** @type {Set<string>} */
const files = new Set();
/** @type {Set<import("node:child_process").ChildProcess>} */
const programs = new Set();

/** Exit codes of signals, as shells have them. */
const SIGNALS = /** @type {const} */ ({ SIGHUP: 129, SIGINT: 130, SIGTERM: 143 });

/** Must be called once, before any file or process is registered. */
export function cleanUpAtExit() {
  process.on("exit", () => {
    for (const program of programs) program.kill("SIGKILL");
    for (const file of files) rmSync(file, { force: true });
  });
  for (const [signal, code] of Object.entries(SIGNALS)) process.once(signal, () => process.exit(code));
}

/** @param {string} file */
export function removeAtExit(file) {
  files.add(file);
}

/** @param {import("node:child_process").ChildProcess} program */
export function killAtExit(program) {
  programs.add(program);
  program.once("exit", () => programs.delete(program));
}
