/** A server of the page and of recordings whose ends it holds back until they are released. */
import { createServer, type Server, type ServerResponse } from "node:http";
import { readFile } from "node:fs/promises";
import type { AddressInfo } from "node:net";
import { extname, join } from "node:path";
import { PAGE } from "./paths.ts";

const TYPES: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
};

export class HeldServer {
  readonly #server: Server;
  readonly #recordings: Readonly<Record<string, { readonly file: string; readonly bytes: number }>>;
  #isReleased = false;
  #release: () => void = () => undefined;
  readonly #released = new Promise<void>((resolve) => (this.#release = resolve));

  /** `recordings`: by name, the file, and how many of its bytes are sent at once. */
  constructor(recordings: Readonly<Record<string, { readonly file: string; readonly bytes: number }>>) {
    this.#recordings = recordings;
    this.#server = createServer((request, response) => {
      const name = new URL(request.url!, "http://localhost").pathname.slice(1);
      this.#answer(name === "" ? "index.html" : name, response).catch(() => response.destroy());
    });
  }

  /** Address of the page with a query. */
  async open(query: string): Promise<string> {
    await new Promise<void>((resolve) => this.#server.listen(0, "127.0.0.1", resolve));
    return `http://127.0.0.1:${(this.#server.address() as AddressInfo).port}/?${query}`;
  }

  /** Sends the rest of all recordings. */
  release(): void {
    this.#isReleased = true;
    this.#release();
  }

  close(): void {
    this.#server.closeAllConnections();
    this.#server.close();
  }

  async #answer(name: string, response: ServerResponse): Promise<void> {
    const recording = this.#recordings[name];
    if (recording === undefined) {
      const content = await readFile(join(PAGE, name)).catch(() => null);
      response.writeHead(content ? 200 : 404, { "content-type": TYPES[extname(name)] ?? "text/plain" });
      response.end(content);
      return;
    }
    const content = await readFile(recording.file);
    response.writeHead(200, { "content-type": "application/octet-stream" });
    const sent = this.#isReleased ? content.length : recording.bytes;
    response.write(content.subarray(0, sent));
    await this.#released;
    response.end(content.subarray(sent));
  }
}
