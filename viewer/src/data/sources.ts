/**
 * Opens runs: from a file, from an address, or as the stream of a live run.
 *
 * Each run has its own worker, which ends with `Run.close`, or if the run cannot be read.
 */

import { CellSet } from "./cell-set.ts";
import { RunModel } from "./run-model.ts";
import type { Reply, Request } from "./protocol.ts";
import { UnreadableError, type Run } from "./run.ts";

/** A live run: the bytes of its recording, in order. */
export interface LiveFeed {
  /** Resolves when the header of the run is complete. */
  readonly run: Promise<Run>;
  /** The bytes are copied. */
  push(bytes: Uint8Array): void;
  /** Ends the stream. */
  end(): void;
}

/**
 * Opens a recording; rejects with an UnreadableError if it is none. The run grows while the file is
 * read.
 */
export function openFile(file: File): Promise<Run> {
  return open(nextId(file.name), file.name, { kind: "file", file }).run;
}

/** Opens the recording at an address. */
export async function openUrl(url: string): Promise<Run> {
  const address = new URL(url, location.href);
  const title = decodeURIComponent(address.pathname.split("/").at(-1) || address.host);
  return await open(nextId(title), title, { kind: "url", url: address.href, title }).run;
}

/** Opens a live run. */
export function openLive(id: string, title: string): LiveFeed {
  const { run, send } = open(id, title, { kind: "live", title });
  return {
    run,
    push: (bytes) => send({ kind: "push", bytes: bytes.slice() }),
    end: () => send({ kind: "end" }),
  };
}

let opened = 0;

function nextId(title: string): string {
  opened++;
  return `${opened}:${title}`;
}

function open(
  id: string,
  title: string,
  first: Request,
): { run: Promise<Run>; send: (request: Request) => void } {
  const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  const send = (request: Request) => {
    worker.postMessage(request, request.kind === "push" ? [request.bytes.buffer] : []);
  };
  const run = new Promise<Run>((resolve, reject) => {
    let model: RunModel | null = null;
    const abort = (message: string) => {
      worker.terminate();
      model?.fail(message);
      reject(new UnreadableError(message));
    };
    worker.onerror = (event) =>
      abort(`${title} cannot be read: ${event.message || "the worker did not start"}`);
    worker.onmessage = ({ data: reply }: MessageEvent<Reply>) => {
      if (reply.kind === "unreadable") {
        abort(reply.message);
      } else if (reply.kind === "opened") {
        const reader = { send, close: () => worker.terminate() };
        try {
          const { size, walls } = reply.terrain;
          const terrain = { ...reply.terrain, walls: new CellSet(size[0] * size[1] * size[2], walls) };
          model = new RunModel(id, title, reply.setup, terrain, reader);
        } catch (error) {
          // A browser may abort the memory that a large map needs.
          const size = reply.terrain.size.join(" x ");
          abort(`${title} cannot be shown: its map has ${size} cells: ${(error as Error).message}`);
        }
      } else if (model) {
        model.take(reply);
        resolve(model);
      }
    };
  });
  send(first);
  return { run, send };
}
