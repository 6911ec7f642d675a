/**
 * Programs that tests start. Each belongs to somebody who ends it; if the test runner itself dies, the kernel ends them.
 */
import { spawn, type ChildProcess } from "node:child_process";

export class Program {
  readonly name: string;
  stdout = "";
  stderr = "";
  /** How it has ended, as soon as it has: its exit code, or -1 after a signal. */
  readonly ended: Promise<number>;
  readonly #child: ChildProcess;
  #code: number | null = null;
  #listeners = new Set<() => void>();

  constructor(path: string, args: readonly string[], env: NodeJS.ProcessEnv) {
    this.name = [path, ...args].join(" ");
    this.#child = spawn("setpriv", ["--pdeathsig", "KILL", path, ...args], {
      env,
      stdio: ["ignore", "pipe", "pipe"],
    });
    this.#child.stdout!.setEncoding("utf8").on("data", (text: string) => {
      this.stdout += text;
      this.#tell();
    });
    this.#child.stderr!.setEncoding("utf8").on("data", (text: string) => {
      this.stderr += text;
      this.#tell();
    });
    this.ended = new Promise((resolve) => {
      const end = (code: number): void => {
        this.#code ??= code;
        resolve(code);
        this.#tell();
      };
      this.#child.on("error", (error) => {
        this.stderr += `${error.message}\n`;
        end(-1);
      });
      this.#child.on("close", (code) => end(code ?? -1));
    });
  }

  /** Waits for what the program says; fails if it ends without having said it. */
  says(stream: "stdout" | "stderr", what: RegExp): Promise<RegExpExecArray> {
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

  /** Ends it without a chance to say anything, and waits until it is gone. */
  async kill(): Promise<void> {
    this.#child.kill("SIGKILL");
    await this.ended;
  }

  #tell(): void {
    for (const listener of [...this.#listeners]) listener();
  }
}

/** Carries out a program that ends by itself; returns what it has printed. */
export async function outputOf(
  path: string,
  args: readonly string[],
  env: NodeJS.ProcessEnv,
): Promise<string> {
  const program = new Program(path, args, env);
  const code = await program.ended;
  if (code !== 0)
    throw new Error(`${program.name} has ended with ${code}: ${program.stdout}${program.stderr}`);
  return program.stdout;
}
