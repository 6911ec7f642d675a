/** Test fixtures: servers, which end with the test, and a page whose unexpected errors fail it. */
import { mkdtempSync } from "node:fs";
import { join } from "node:path";
import { test as base, type Page } from "@playwright/test";
import { HeldServer } from "./held-server.ts";
import { binary, environment, PAGE, RUN_SCRIPT, SCENARIO } from "./paths.ts";
import { outputOf, Program } from "./programs.ts";
import { temporaryFolder } from "./recordings.ts";
import { digestIn, parseInfo, type Info } from "./info.ts";

/**
 * Console messages of the browser about unreachable connections or files, which a page cannot
 * prevent.
 */
const FAILED_CONNECTION = /^(WebSocket connection to|Failed to load resource)/;

/** The details of a test that `npm run e2e` runs, and `npm run e2e:short` leaves out. */
export const LONG = { tag: "@long" };

export class Servers {
  readonly #programs: Program[] = [];
  readonly #held: HeldServer[] = [];
  readonly #env: NodeJS.ProcessEnv;

  constructor(worker: number) {
    this.#env = environment(worker);
  }

  /** Serves the page with a recording, or with two; returns its address. */
  async view(file: string, beside?: string): Promise<string> {
    const second = beside === undefined ? [] : ["--beside", beside];
    const flags = ["--address", "127.0.0.1:0", "--page", PAGE, ...second];
    const server = this.#start("maes", ["view", file, "--browser", "false", ...flags]);
    return (await server.prints("stdout", /^(http:\S+)$/m))[1]!;
  }

  /** Serves the page with a map, in a folder where its scenarios are run; returns its address. */
  async map(file: string, folder: string, flags: readonly string[] = []): Promise<string> {
    const all = ["view", file, "--address", "127.0.0.1:0", "--page", PAGE, "--browser", "false", ...flags];
    const server = this.#program(binary("maes"), all, folder);
    return (await server.prints("stdout", /^(http:\S+)$/m))[1]!;
  }

  /** What `maes` prints in a folder. */
  async maes(args: readonly string[], folder: string): Promise<string> {
    return outputOf(binary("maes"), args, this.#env, folder);
  }

  /** Serves a folder by a static web server, which knows nothing of runs; returns its address. */
  async folder(path: string): Promise<string> {
    const server = this.#program("python3", ["-u", "-m", "http.server", "0", "--bind", "127.0.0.1"], path);
    return (await server.prints("stdout", /\((http:\S+)\)/))[1]!;
  }

  /** Writes a folder with the page and recordings; returns the lines that `maes view` prints. */
  async export(folder: string, file: string, beside?: string): Promise<string[]> {
    const second = beside === undefined ? [] : ["--beside", beside];
    const flags = ["view", file, ...second, "--export", folder, "--page", PAGE];
    return (await outputOf(binary("maes"), flags, this.#env)).trimEnd().split("\n");
  }

  /** Starts a run that can be observed; returns the server and the address of the page. */
  async run(flags: readonly string[], address = "127.0.0.1:0"): Promise<{ server: Program; url: string }> {
    const server = this.#start("sim_server", ["run", ...flags, "--view", address, "--page", PAGE]);
    const url = (await server.prints("stderr", /(http:\/\/\S+)\s/))[1]!;
    return { server, url };
  }

  /** `maes run` with a page that stays after the run; the program and the address of the page. */
  async viewedRun(flags: readonly string[]): Promise<{ run: Program; url: string }> {
    const view = ["--view", "127.0.0.1:0", "--page", PAGE, "--stay"];
    const folder = mkdtempSync(join(temporaryFolder(), "viewed-"));
    const run = this.#program(binary("maes"), ["run", ...flags, ...view], folder);
    const url = (await run.prints("stderr", /(http:\/\/\S+)\s/))[1]!;
    return { run, url };
  }

  /** Starts the agents of a run, in one process. */
  agents(count: number): Program {
    return this.#start("agent_node", ["--id", `0-${count - 1}`]);
  }

  /**
   * Serves the page without a simulator, and recordings of which the first bytes are sent at once and
   * the rest when they are released.
   */
  held(recordings: ConstructorParameters<typeof HeldServer>[0]): HeldServer {
    const server = new HeldServer(recordings);
    this.#held.push(server);
    return server;
  }

  async info(file: string): Promise<Info> {
    return parseInfo(await outputOf(binary("maes"), ["info", file], this.#env));
  }

  /** The value of a scenario key, as the server reads it. */
  async scenarioKey(file: string, key: string): Promise<string> {
    return (await outputOf(binary("maes"), ["scenario", file, "--get", key], this.#env)).trim();
  }

  /** The digest of a run without observers. */
  async digestUnobserved(flags: readonly string[]): Promise<string> {
    return digestIn(await outputOf(RUN_SCRIPT, [SCENARIO, "--transport", "memory", ...flags], this.#env));
  }

  async endAll(): Promise<void> {
    for (const server of this.#held) server.close();
    await Promise.all(this.#programs.map((program) => program.kill()));
  }

  #start(name: "maes" | "sim_server" | "agent_node", args: readonly string[]): Program {
    return this.#program(binary(name), args);
  }

  #program(path: string, args: readonly string[], folder?: string): Program {
    const program = new Program(path, args, this.#env, folder);
    this.#programs.push(program);
    return program;
  }
}

interface Fixtures {
  readonly servers: Servers;
  /** Checks another page for errors as well. */
  readonly watch: (page: Page) => void;
}

export const test = base.extend<Fixtures>({
  // eslint-disable-next-line no-empty-pattern -- a fixture that needs no other is written so
  servers: async ({}, use, info) => {
    const servers = new Servers(info.parallelIndex);
    await use(servers);
    await servers.endAll();
  },
  // eslint-disable-next-line no-empty-pattern -- as above
  watch: async ({}, use) => {
    const errors: string[] = [];
    await use((page) => {
      page.on("pageerror", (error) => errors.push(error.message));
      page.on("console", (message) => {
        if (message.type() === "error" && !FAILED_CONNECTION.test(message.text()))
          errors.push(message.text());
      });
    });
    expect(errors, "errors of the page").toEqual([]);
  },
  page: async ({ page, watch }, use) => {
    watch(page);
    await use(page);
  },
});

export const { expect } = test;
