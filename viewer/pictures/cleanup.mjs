/**
 * What must not be left behind: files that are not complete yet, and programs that were started. Whatever way this process ends,
 * short of SIGKILL, the files are removed and the programs ended. (The browser is ended by Playwright, in the same way.)
 */
import { rmSync } from "node:fs";
import process from "node:process";

/** @type {Set<string>} */
const files = new Set();
/** @type {Set<import("node:child_process").ChildProcess>} */
const programs = new Set();

/** Exit codes as shells count them. */
const SIGNALS = /** @type {const} */ ({ SIGHUP: 129, SIGINT: 130, SIGTERM: 143 });

/** To be called once, before there is anything that could be left. */
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
