/** Reads recordings in tests as the worker does, without a worker. */

import { RunModel } from "./model.ts";
import type { Request } from "./protocol.ts";
import { Reading } from "./reading.ts";
import { loadZstd } from "./zstd.ts";

const zstd = await loadZstd();

/** A run read from bytes that come in pieces of a size, with a batch after each, of which the last one is told of as such. */
export function readRun(
  bytes: Uint8Array,
  pieceBytes: number = bytes.length,
  afterBatch: (run: RunModel, isLast: boolean) => void = () => {},
): RunModel {
  const fetchBytes = (start: number, length: number) =>
    Promise.resolve(bytes.subarray(start, start + length));
  const reading = new Reading("test.mcap", zstd, fetchBytes);
  let model: RunModel | null = null;
  const ask = (request: Request) => {
    if (request.kind === "follow") {
      const knownTick = reading.follow(request.request, request.agent);
      model?.take({ kind: "belief", request: request.request, knownTick });
    } else if (request.kind === "hits") {
      const { agent, untilTick, scan } = request;
      void reading
        .hits(agent, untilTick, scan)
        .then((hits) => model?.take({ kind: "hits", request: request.request, hits }));
    }
  };
  const send = (isLast: boolean) => {
    if (!reading.opening) {
      return;
    }
    model ??= new RunModel("test", "test.mcap", reading.opening.setup, reading.opening.terrain, {
      ask,
      close: () => {},
    });
    const batch = reading.takeBatch();
    if (batch) {
      model.take({ kind: "batch", batch });
    }
    afterBatch(model, isLast);
  };
  for (let at = 0; at < bytes.length && !reading.isAtEnd; at += pieceBytes) {
    reading.push(bytes.subarray(at, at + pieceBytes));
    send(false);
  }
  reading.finish();
  send(true);
  return model!;
}
