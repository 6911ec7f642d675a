/**
 * The reader worker: bytes of a file, an address or a live run in; batches out.
 *
 * It sends some twenty batches per second at most, so that the page stays responsive, and answers
 * queries between two pieces of a file. Of a recording it reads the start, which the first picture
 * needs, and the rest when the page asks for it. The logic is in `recording-reader.ts`.
 */

import { isMapFile, mapRun } from "./map-run.ts";
import { transferablesOf, type Reply, type Request } from "./protocol.ts";
import { AttachmentSearch, type Attachments } from "./attachment-search.ts";
import { MissingAttachmentError, RecordingReader, type FetchBytes } from "./recording-reader.ts";
import type { RunHeader } from "./run-header.ts";
import { UnreadableError } from "./run.ts";
import { loadZstd } from "./zstd.ts";

const BATCH_PERIOD_MS = 50;

/** Small, so that the first image comes soon. */
const FIRST_PIECE_BYTES = 1 << 18;
const PIECE_BYTES = 1 << 20;

interface Scope {
  onmessage: ((event: MessageEvent<Request>) => void) | null;
  postMessage(reply: Reply, transfer?: readonly Transferable[]): void;
}
const scope = self as unknown as Scope;

const zstd = loadZstd();
let reader: RecordingReader | null = null;
/** Queries and pieces of a live run that arrived before the reader was ready. */
const waiting: Request[] = [];
let isOpened = false;
let hasFailed = false;
let lastBatchMs = -Infinity;
let timer: ReturnType<typeof setTimeout> | null = null;
let readOn: () => void = () => undefined;
const mayReadOn = new Promise<void>((resolve) => (readOn = resolve));

function postHeader({ setup, terrain }: RunHeader): void {
  scope.postMessage({ kind: "opened", setup, terrain: { ...terrain, walls: terrain.walls.bytes } });
}

function sendBatch(): void {
  if (timer !== null) {
    clearTimeout(timer);
    timer = null;
  }
  const header = reader?.header;
  if (!reader || !header) {
    return;
  }
  if (!isOpened) {
    isOpened = true;
    postHeader(header);
  }
  const batch = reader.takeBatch();
  if (batch) {
    lastBatchMs = performance.now();
    scope.postMessage({ kind: "batch", batch }, transferablesOf(batch) as ArrayBuffer[]);
  }
}

/** Sends a batch now, or when the batch period is over. */
function sendInTime(): void {
  const waitMs = lastBatchMs + BATCH_PERIOD_MS - performance.now();
  if (waitMs <= 0) {
    sendBatch();
  } else {
    timer ??= setTimeout(sendBatch, waitMs);
  }
}

/** Sends what was read, and waits for the page when that is the start of a recording. */
async function pieceRead(reading: RecordingReader): Promise<void> {
  sendInTime();
  if (reading.hasStart) await mayReadOn;
}

/** Reports an error; `subject` names the source unless the error does. */
function fail(subject: string, error: unknown): void {
  const reason = error instanceof Error ? error.message : String(error);
  const message = error instanceof UnreadableError ? reason : `${subject} cannot be read: ${reason}`;
  if (isOpened) {
    reader?.abort(message);
    sendBatch();
  } else if (!hasFailed) {
    hasFailed = true;
    scope.postMessage({ kind: "unreadable", message });
  }
}

async function begin(
  title: string,
  fetchBytes: FetchBytes | null,
  found: Attachments | null = null,
): Promise<RecordingReader> {
  const reading = new RecordingReader(title, await zstd, fetchBytes, found);
  reader = reading;
  waiting.splice(0).forEach(answer);
  return reading;
}

/** A map file has no recording to query: it is sent as a whole. */
function showMap(name: string, bytes: Uint8Array): void {
  const { header, batch } = mapRun(name, bytes);
  isOpened = true;
  postHeader(header);
  scope.postMessage({ kind: "batch", batch });
}

async function readFile(file: File): Promise<void> {
  if (isMapFile(file.name)) {
    showMap(file.name, new Uint8Array(await file.arrayBuffer()));
    return;
  }
  const fetchBytes: FetchBytes = async (start, length) =>
    new Uint8Array(await file.slice(start, start + length).arrayBuffer());
  async function* pieces(): AsyncGenerator<Uint8Array> {
    let bytes = FIRST_PIECE_BYTES;
    for (let at = 0; at < file.size; at += bytes, bytes = PIECE_BYTES) yield await fetchBytes(at, bytes);
  }
  await readPasses(file.name, fetchBytes, pieces);
}

/**
 * Reads a recording; one whose attachments are not where they should be in two passes, of which the
 * first looks for them.
 */
async function readPasses(
  title: string,
  fetchBytes: FetchBytes | null,
  pieces: () => AsyncIterable<Uint8Array>,
): Promise<void> {
  try {
    await readPass(await begin(title, fetchBytes), pieces());
  } catch (error) {
    if (!(error instanceof MissingAttachmentError)) throw error;
    const search = new AttachmentSearch(await zstd);
    for await (const piece of pieces()) {
      search.push(piece);
      if (search.isAtEnd) break;
    }
    if (search.found === null) throw error;
    await readPass(await begin(title, fetchBytes, search.found), pieces());
  }
}

async function readPass(reading: RecordingReader, pieces: AsyncIterable<Uint8Array>): Promise<void> {
  for await (const piece of pieces) {
    reading.push(piece);
    await pieceRead(reading);
    if (reading.isAtEnd) break;
  }
  reading.finish();
  sendBatch();
}

async function readUrl(url: string, title: string): Promise<void> {
  const request = async (): Promise<Response> => {
    const response = await fetch(url, { headers: { Range: "bytes=0-" } });
    if (!response.ok || !response.body) {
      throw new UnreadableError(
        `${url} cannot be read: the server answers ${response.status} ${response.statusText}`,
      );
    }
    return response;
  };
  let response: Response | null = await request();
  if (isMapFile(title)) {
    showMap(title, new Uint8Array(await response.arrayBuffer()));
    return;
  }
  const fetchRange: FetchBytes = async (start, length) => {
    const part = await fetch(url, { headers: { Range: `bytes=${start}-${start + length - 1}` } });
    return new Uint8Array(await part.arrayBuffer());
  };
  const fetchBytes = response.status === 206 ? fetchRange : null;
  async function* pieces(): AsyncGenerator<Uint8Array> {
    const body = (response ?? (await request())).body!.getReader();
    response = null;
    try {
      for (let piece = await body.read(); !piece.done; piece = await body.read()) yield piece.value;
    } finally {
      void body.cancel();
    }
  }
  await readPasses(title, fetchBytes, pieces);
}

function answer(request: Request): void {
  if (!reader) {
    waiting.push(request);
    return;
  }
  switch (request.kind) {
    case "push":
    case "end":
      if (hasFailed) {
        return;
      }
      try {
        if (request.kind === "push") {
          reader.push(request.bytes);
        } else {
          reader.finish();
        }
        sendInTime();
      } catch (error) {
        fail("the run", error);
      }
      break;
    case "follow": {
      const learned = reader.follow(request.request, request.agent);
      scope.postMessage(
        { kind: "belief", request: request.request, learned },
        learned ? [learned.buffer] : [],
      );
      break;
    }
    case "hits":
      void reader
        .hits(request.agent, request.untilTick, request.scan)
        .then((hits) => scope.postMessage({ kind: "hits", request: request.request, hits }));
      break;
  }
}

scope.onmessage = ({ data: request }) => {
  switch (request.kind) {
    case "file":
      readFile(request.file).catch((error: unknown) => fail(request.file.name, error));
      break;
    case "url":
      readUrl(request.url, request.title).catch((error: unknown) => fail(request.url, error));
      break;
    case "readOn":
      readOn();
      break;
    case "live":
      begin(request.title, null).catch((error: unknown) => fail(request.title, error));
      break;
    default:
      answer(request);
  }
};
