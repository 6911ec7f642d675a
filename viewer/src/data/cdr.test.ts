import { CdrWriter } from "@foxglove/cdr";
import { expect, test } from "vitest";
import { CdrReader } from "./cdr.ts";

test("reads the output of another library", () => {
  const writer = new CdrWriter();
  writer
    .uint8(1)
    .uint16(2)
    .uint8(3)
    .uint32(4)
    .uint8(5)
    .float64(6.5)
    .uint8(7)
    .uint64(2n ** 40n)
    .int32(-8);
  writer
    .uint8Array(new TextEncoder().encode("höhle\0"), true)
    .uint8(9)
    .float64Array([1.5, -2], true)
    .uint8(10)
    .uint8Array(Uint8Array.of(1, 2), true);
  writer.uint8(11).uint32Array([70000, 3], true).uint16Array([65535, 1], true).uint8(12);
  // An empty sequence has no element alignment.
  writer.float64Array([], true).uint8(13);
  const reader = new CdrReader(writer.data);
  expect([reader.u8(), reader.u16(), reader.u8(), reader.u32(), reader.u8(), reader.f64()]).toEqual([
    1, 2, 3, 4, 5, 6.5,
  ]);
  expect([reader.u8(), reader.u64(), reader.i32(), reader.string(), reader.u8()]).toEqual([
    7,
    2 ** 40,
    -8,
    "höhle",
    9,
  ]);
  expect([reader.f64s(), reader.u8(), Array.from(reader.bytes()), reader.u8()]).toEqual([
    [1.5, -2],
    10,
    [1, 2],
    11,
  ]);
  const runs = reader.runs();
  expect([Array.from(runs.start), Array.from(runs.length), reader.u8()]).toEqual([
    [70000, 3],
    [65535, 1],
    12,
  ]);
  expect([reader.f64s(), reader.u8()]).toEqual([[], 13]);
  expect(() => reader.u8()).toThrow(RangeError);
});

test("unaligned bytes are read", () => {
  const written = new CdrWriter().uint8(1).float64(2.5).uint32Array([9], true).uint16Array([1], true).data;
  for (let shift = 0; shift < 8; shift++) {
    const bytes = new Uint8Array(written.length + shift);
    bytes.set(written, shift);
    const reader = new CdrReader(bytes.subarray(shift));
    expect([reader.u8(), reader.f64(), reader.runs().start[0]]).toEqual([1, 2.5, 9]);
  }
});

test("too long sequences are rejected before allocation", () => {
  const long = (elements: number) => new CdrReader(new CdrWriter().uint32(elements).uint32(0).data);
  expect(() => long(0xffffffff).f64s()).toThrow("4294967295 elements in 4 bytes");
  expect(() => long(2).runs()).toThrow(RangeError);
  expect(() => long(5).bytes()).toThrow(RangeError);
  expect(() =>
    new CdrReader(new CdrWriter().uint32Array([1, 2], true).uint16Array([1], true).data).runs(),
  ).toThrow("2 runs with 1 lengths");
});

test("other encapsulations are rejected", () => {
  expect(() => new CdrReader(Uint8Array.of(0, 0, 0, 0, 1))).toThrow("not little-endian CDR");
  expect(() => new CdrReader(Uint8Array.of(0, 1, 0))).toThrow("not little-endian CDR");
});
