/** Reads recordings in tests as the worker does, without a worker. */

import type { Attachments } from "./attachment-search.ts";
import { RunModel } from "./run-model.ts";
import type { Request } from "./protocol.ts";
import { RecordingReader } from "./recording-reader.ts";
import { loadZstd } from "./zstd.ts";

const zstd = await loadZstd();

/**
 * Reads a run from pieces of `pieceBytes`, with a batch after each; `afterBatch` is called for
 * every batch. `found` are attachments that are not where they should be.
 */
export function readRun(
  bytes: Uint8Array,
  pieceBytes: number = bytes.length,
  afterBatch: (run: RunModel, isLast: boolean) => void = () => {},
  found: Attachments | null = null,
): RunModel {
  const fetchBytes = (start: number, length: number) =>
    Promise.resolve(bytes.subarray(start, start + length));
  const reader = new RecordingReader("test.mcap", zstd, fetchBytes, found);
  let model: RunModel | null = null;
  const send = (request: Request) => {
    if (request.kind === "follow") {
      const learned = reader.follow(request.request, request.agent);
      model?.take({ kind: "belief", request: request.request, learned });
    } else if (request.kind === "hits") {
      const { agent, untilTick, scan } = request;
      void reader
        .hits(agent, untilTick, scan)
        .then((hits) => model?.take({ kind: "hits", request: request.request, hits }));
    }
  };
  const flush = (isLast: boolean) => {
    if (!reader.header) {
      return;
    }
    model ??= new RunModel("test", "test.mcap", reader.header.setup, reader.header.terrain, {
      send,
      close: () => {},
    });
    const batch = reader.takeBatch();
    if (batch) {
      model.take({ kind: "batch", batch });
    }
    afterBatch(model, isLast);
  };
  for (let at = 0; at < bytes.length && !reader.isAtEnd; at += pieceBytes) {
    reader.push(bytes.subarray(at, at + pieceBytes));
    flush(false);
  }
  reader.finish();
  flush(true);
  return model!;
}
