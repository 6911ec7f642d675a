/**
 * Child processes of tests. The test that starts one ends it; if the test runner dies, the kernel
 * does.
 */
import { spawn, type ChildProcess } from "node:child_process";

export class Program {
  readonly name: string;
  stdout = "";
  stderr = "";
  /** Exit code, or -1 after a signal. */
  readonly ended: Promise<number>;
  readonly #child: ChildProcess;
  #code: number | null = null;
  #listeners = new Set<() => void>();

  /** `folder`: its working directory; otherwise that of the tests. */
  constructor(path: string, args: readonly string[], env: NodeJS.ProcessEnv, folder?: string) {
    this.name = [path, ...args].join(" ");
    this.#child = spawn("setpriv", ["--pdeathsig", "KILL", path, ...args], {
      env,
      cwd: folder,
      stdio: ["ignore", "pipe", "pipe"],
    });
    this.#child.stdout!.setEncoding("utf8").on("data", (text: string) => {
      this.stdout += text;
      this.#notify();
    });
    this.#child.stderr!.setEncoding("utf8").on("data", (text: string) => {
      this.stderr += text;
      this.#notify();
    });
    this.ended = new Promise((resolve) => {
      const end = (code: number): void => {
        this.#code ??= code;
        resolve(code);
        this.#notify();
      };
      this.#child.on("error", (error) => {
        this.stderr += `${error.message}\n`;
        end(-1);
      });
      this.#child.on("close", (code) => end(code ?? -1));
    });
  }

  /** Waits for output that matches; rejects if the process ends without it. */
  prints(stream: "stdout" | "stderr", what: RegExp): Promise<RegExpExecArray> {
    return new Promise((resolve, reject) => {
      const look = (): void => {
        const found = what.exec(this[stream]);
        if (!found && this.#code === null) return;
        this.#listeners.delete(look);
        if (found) resolve(found);
        else reject(new Error(`${this.name} has ended with ${this.#code}: ${this.stdout}${this.stderr}`));
      };
      this.#listeners.add(look);
      look();
    });
  }

  /** Interrupts the process, as Ctrl-C does; resolves to its exit code. */
  interrupt(): Promise<number> {
    this.#child.kill("SIGINT");
    return this.ended;
  }

  /** Kills the process and waits for its end. */
  async kill(): Promise<void> {
    this.#child.kill("SIGKILL");
    await this.ended;
  }

  #notify(): void {
    for (const listener of [...this.#listeners]) listener();
  }
}

/** Executes a program to its end, in a folder; returns its standard output. */
export async function outputOf(
  path: string,
  args: readonly string[],
  env: NodeJS.ProcessEnv,
  folder?: string,
): Promise<string> {
  const program = new Program(path, args, env, folder);
  const code = await program.ended;
  if (code !== 0)
    throw new Error(`${program.name} has ended with ${code}: ${program.stdout}${program.stderr}`);
  return program.stdout;
}
