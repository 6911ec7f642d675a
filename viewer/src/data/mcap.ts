/**
 * Incremental MCAP reader, from the first byte to the last.
 *
 * This module finds the record boundaries, so that it can report where a file is damaged and never
 * buffers more than the longest allowed record; `@mcap/core` decodes records and chunks, and checks
 * the CRC of a chunk before it returns the first message. The same code reads finished files,
 * truncated files, and streams without chunks.
 *
 * Invariants: nothing behind a damaged record is returned; no input makes it throw.
 */

import { McapStreamReader, type McapTypes } from "@mcap/core";

const MAGIC = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a];

/** Opcode and length of a record. */
const RECORD_HEADER_BYTES = 9;

/** Channel, sequence number and two timestamps of a message. */
const MESSAGE_HEADER_BYTES = 22;

/**
 * Upper bound of any record that the simulator writes, so that a damaged length cannot exhaust the
 * memory.
 */
const RECORD_BYTES_MAX = 2 ** 28;

const MESSAGE = 0x05;
const ATTACHMENT = 0x09;
const DATA_END = 0x0f;

/** Byte range of a record in the file. */
export interface RecordLocation {
  readonly start: number;
  readonly length: number;
}

export interface McapSink {
  attachment(name: string, bytes: Uint8Array): void;
  channel(id: number, topic: string, type: string): void;
  /**
   * The reader reuses `bytes`; the sink must not keep them. `location` is the record that contains
   * the message: a chunk, or the message record itself.
   */
  message(channel: number, timeNs: bigint, bytes: Uint8Array, location: RecordLocation): void;
}

/** How reading ended. */
export type McapEnd =
  | { readonly kind: "whole" }
  | { readonly kind: "not mcap"; readonly found: string }
  | { readonly kind: "missing" | "cut off"; readonly bytes: number }
  | { readonly kind: "damaged" | "unsupported"; readonly byte: number; readonly reason: string };

/** A chunk that is whole, and that this module cannot decompress. */
class UnsupportedError extends RangeError {}

type Decompress = (bytes: Uint8Array, length: number) => Uint8Array;

export class McapScanner {
  readonly #sink: McapSink;
  readonly #records: McapStreamReader;
  readonly #types = new Map<number, string>();
  /** Bytes of the incomplete record. */
  #rest = new Uint8Array(0);
  #restBytes = 0;
  /** File offset of `#rest`. */
  #position = 0;
  #end: McapEnd | null = null;

  constructor(sink: McapSink, zstd: Decompress) {
    this.#sink = sink;
    this.#records = new McapStreamReader({
      noMagicPrefix: true,
      decompressHandlers: { zstd: (bytes, length) => decompressed(zstd, bytes, length), lz4 },
    });
  }

  /** How reading ended; null while it continues. */
  get end(): McapEnd | null {
    return this.#end;
  }

  /** Reads the next bytes of the file. */
  push(bytes: Uint8Array): void {
    let ahead = bytes;
    while (this.#end === null) {
      const needed = this.#neededBytes(ahead);
      if (needed === null) {
        return;
      }
      const missing = needed - this.#restBytes;
      if (ahead.length < missing) {
        this.#keep(ahead);
        return;
      }
      const part = ahead.subarray(0, missing);
      ahead = ahead.subarray(missing);
      if (this.#restBytes === 0) {
        this.#takeRecord(part);
      } else {
        this.#keep(part);
        const whole = this.#rest.subarray(0, this.#restBytes);
        this.#restBytes = 0;
        this.#rest = new Uint8Array(0);
        this.#takeRecord(whole);
      }
      this.#position += needed;
    }
  }

  /** Ends the input. */
  finish(): McapEnd {
    const bytes = this.#position + this.#restBytes;
    if (this.#position === 0 && this.#end === null) {
      this.#end = {
        kind: "not mcap",
        found: bytes === 0 ? "an empty file" : `only ${bytes} bytes`,
      };
    }
    this.#end ??= { kind: this.#restBytes === 0 ? "missing" : "cut off", bytes };
    return this.#end;
  }

  /** Stops reading at a malformed record. */
  #damage(reason: string): void {
    this.#end ??= { kind: "damaged", byte: this.#position, reason };
  }

  /**
   * Length of the next record, or of the header that determines it; null if the file cannot be read
   * any further.
   */
  #neededBytes(ahead: Uint8Array): number | null {
    if (this.#position === 0) {
      return MAGIC.length;
    }
    if (this.#restBytes + ahead.length < RECORD_HEADER_BYTES) {
      return RECORD_HEADER_BYTES;
    }
    const header = new Uint8Array(RECORD_HEADER_BYTES);
    const kept = Math.min(this.#restBytes, RECORD_HEADER_BYTES);
    header.set(this.#rest.subarray(0, kept));
    header.set(ahead.subarray(0, RECORD_HEADER_BYTES - kept), kept);
    const length = new DataView(header.buffer).getBigUint64(1, true);
    if (header[0]! === 0 || header[0]! > DATA_END) {
      this.#damage(`unknown record opcode 0x${header[0]!.toString(16).padStart(2, "0")}`);
      return null;
    }
    if (length > RECORD_BYTES_MAX) {
      this.#damage(`a record of ${length} bytes, above the limit of ${RECORD_BYTES_MAX}`);
      return null;
    }
    return RECORD_HEADER_BYTES + Number(length);
  }

  #keep(bytes: Uint8Array): void {
    const needed = this.#restBytes + bytes.length;
    if (needed > this.#rest.length) {
      const longer = new Uint8Array(Math.max(needed, 2 * this.#rest.length));
      longer.set(this.#rest.subarray(0, this.#restBytes));
      this.#rest = longer;
    }
    this.#rest.set(bytes, this.#restBytes);
    this.#restBytes = needed;
  }

  /** Reads a complete record, or the magic bytes. */
  #takeRecord(record: Uint8Array): void {
    if (this.#position === 0) {
      if (!MAGIC.every((byte, at) => record[at] === byte)) {
        const found = Array.from(record, (byte) => byte.toString(16).padStart(2, "0")).join(" ");
        this.#end = { kind: "not mcap", found: `the bytes ${found}` };
      }
      return;
    }
    if (record[0] === DATA_END) {
      this.#end = { kind: "whole" };
      return;
    }
    try {
      if (record[0] === ATTACHMENT) {
        checkAttachment(record);
      }
      this.#records.append(record);
      const location = { start: this.#position, length: record.length };
      for (let found = this.#records.nextRecord(); found !== undefined; found = this.#records.nextRecord()) {
        this.#emit(found, location);
      }
    } catch (error) {
      const reason = error instanceof Error ? error.message : String(error);
      if (error instanceof UnsupportedError) {
        this.#end ??= { kind: "unsupported", byte: this.#position, reason };
      }
      this.#damage(reason);
    }
  }

  #emit(record: McapTypes.TypedMcapRecord, location: RecordLocation): void {
    switch (record.type) {
      case "Attachment":
        this.#sink.attachment(record.name, record.data);
        break;
      case "Schema":
        this.#types.set(record.id, record.name);
        break;
      case "Channel":
        this.#sink.channel(record.id, record.topic, this.#types.get(record.schemaId) ?? "");
        break;
      case "Message":
        this.#sink.message(record.channelId, record.logTime, record.data, location);
        break;
    }
  }
}

/** Checks the data length of an attachment, which the library does not. */
function checkAttachment(record: Uint8Array): void {
  const view = new DataView(record.buffer, record.byteOffset, record.byteLength);
  let at = RECORD_HEADER_BYTES + 16;
  at += 4 + view.getUint32(at, true);
  at += 4 + view.getUint32(at, true);
  const length = view.getBigUint64(at, true);
  if (length !== BigInt(record.length - at - 8 - 4)) {
    throw new RangeError(`an attachment of ${length} bytes in a record of ${record.length}`);
  }
}

function lz4(): never {
  throw new UnsupportedError(
    "its chunks are compressed with lz4; `maes recover FILE -o OTHER` writes them with zstd",
  );
}

function decompressed(zstd: Decompress, bytes: Uint8Array, length: bigint): Uint8Array {
  if (length > RECORD_BYTES_MAX) {
    throw new RangeError(`a chunk of ${length} bytes, above the limit of ${RECORD_BYTES_MAX}`);
  }
  const content = zstd(bytes, Number(length));
  if (content.length !== Number(length)) {
    throw new RangeError(`a chunk of ${content.length} bytes whose header says ${length}`);
  }
  return content;
}

/** The decompressed content of a chunk record; empty for other records. */
export function chunkContent(record: Uint8Array, zstd: Decompress): Uint8Array {
  const reader = new McapStreamReader({ noMagicPrefix: true, includeChunks: true });
  reader.append(record);
  const chunk = reader.nextRecord();
  if (chunk?.type !== "Chunk") {
    return new Uint8Array(0);
  }
  return chunk.compression === "" ? chunk.records : decompressed(zstd, chunk.records, chunk.uncompressedSize);
}

/** The message of a channel and a log time in the content of a chunk; null if there is none. */
export function messageIn(content: Uint8Array, channel: number, timeNs: bigint): Uint8Array | null {
  const view = new DataView(content.buffer, content.byteOffset, content.byteLength);
  for (let at = 0; at + RECORD_HEADER_BYTES <= content.length;) {
    const start = at + RECORD_HEADER_BYTES;
    const end = start + Number(view.getBigUint64(at + 1, true));
    if (
      content[at] === MESSAGE &&
      view.getUint16(start, true) === channel &&
      view.getBigUint64(start + 6, true) === timeNs
    ) {
      return content.subarray(start + MESSAGE_HEADER_BYTES, end);
    }
    at = end;
  }
  return null;
}
