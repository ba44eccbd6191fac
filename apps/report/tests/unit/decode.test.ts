// SPDX-License-Identifier: BSD-3-Clause
import { deflateSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { DataError, bytesOfBase64, decodeFloats, decodeIndices, decodeNumbers, decodePositions } from "../../src/data/decode";
import { decodeGraph } from "../../src/data/graph";
import { Ids } from "../../src/data/ids";
import { pack } from "../page/synthetic.mjs";

const base64 = (bytes: Uint8Array) => Buffer.from(bytes).toString("base64");

describe("arrays of numbers", () => {
  test("base64 gives the bytes, with the browser's decoder and without", () => {
    expect([...bytesOfBase64("AAEC/w==")]).toEqual([0, 1, 2, 255]);
    expect(() => bytesOfBase64("§")).toThrow();
  });

  test("are little endian, whatever their type", async () => {
    const bytes = Uint8Array.from([0, 0, 128, 63, 0, 0, 0, 192]);
    const floats = await decodeNumbers({ type: "f32", count: 2, base64: base64(bytes) }, "here");
    expect([...(floats as Float32Array)]).toEqual([1, -2]);
    const wide = await decodeNumbers(pack(BigInt64Array.from([-5n, 2n ** 62n])), "here");
    expect([...(wide as BigInt64Array)]).toEqual([-5n, 4611686018427387904n]);
  });

  test("are inflated where they are deflated", async () => {
    const numbers = Int32Array.from([7, 7, 7, -1]);
    const text = deflateSync(new Uint8Array(numbers.buffer)).toString("base64");
    expect([...(await decodeNumbers({ type: "i32", count: 4, deflate: text }, "here"))]).toEqual([7, 7, 7, -1]);
  });

  test("may be a plain list, in which null is NaN", async () => {
    const numbers = await decodeFloats([1, null, 3], "here", 3);
    expect([...numbers]).toEqual([1, NaN, 3]);
  });

  test("of the wrong number are refused, and it is said where", async () => {
    const packed = { ...pack(Float32Array.from([1, 2, 3])), count: 4 };
    await expect(decodeNumbers(packed, "graph 1, positions")).rejects.toThrow(/graph 1, positions: 12 bytes/);
    await expect(decodeFloats([1, 2], "there", 3)).rejects.toThrow("there: 2 numbers instead of 3");
    await expect(decodeNumbers({ type: "f32", count: 1, deflate: "AAAA" }, "x")).rejects.toThrow(DataError);
    await expect(decodeNumbers({ type: "toString" as "f32", count: 1, base64: "" }, "x")).rejects.toThrow("no such type");
  });

  test("that are indices must point at something", async () => {
    await expect(decodeIndices([0, 5], "edges, a", 0, 5)).rejects.toThrow("edges, a: entry 1 is 5");
    expect([...(await decodeIndices([-1, 4], "edges, b", -1, 5))]).toEqual([-1, 4]);
  });
});

describe("positions", () => {
  test("of a plan get z = 0", async () => {
    expect([...(await decodePositions([1, 2, 3, 4], 2, 2, "p"))]).toEqual([1, 2, 0, 3, 4, 0]);
  });

  test("in 16 bits span their box, and 65535 is nowhere", async () => {
    const packed = { ...pack(Uint16Array.from([0, 65534, 65535, 32767])), min: [-10, 100], max: [10, 300] };
    const xyz = await decodePositions(packed, 2, 2, "p");
    expect(xyz[0]).toBe(-10);
    expect(xyz[1]).toBe(300);
    expect(xyz[3]).toBeNaN();
    expect(xyz[4]).toBeCloseTo(200, 2);
    await expect(decodePositions(pack(new Uint16Array(2)), 2, 1, "p")).rejects.toThrow('"min" and "max"');
  });
});

describe("ids", () => {
  test("may be numbers of 64 bits, text, or counted, and are found again", async () => {
    const wide = await Ids.decode(pack(BigInt64Array.from([9007199254740993n, 3n])), 2, "ids");
    expect(wide.label(0)).toBe("9007199254740993");
    expect(wide.find(" 3 ")).toBe(1);
    const names = await Ids.decode(["x0", "__proto__"], 2, "ids");
    expect(names.find("__proto__")).toBe(1);
    expect(names.find("constructor")).toBe(-1);
    const symbols = await Ids.decode(pack(BigInt64Array.from([(120n << 45n) + 3n, (90n << 45n), 91n << 45n])), 3, "ids");
    expect([symbols.label(0), symbols.label(1), symbols.label(2)]).toEqual(["x3", "Z0", String(91n << 45n)]);
    expect(symbols.find("x3")).toBe(0);
    const counted = await Ids.decode("sequence", 5, "ids");
    expect([counted.label(4), counted.find("4"), counted.find("5")]).toEqual(["4", 4, -1]);
  });
});

describe("a graph", () => {
  const small = () => ({
    name: "g", dimension: 2 as const, variables: { count: 2 }, edges: { count: 1, a: [0], b: [1], class: [9] },
    estimates: [{ name: "e", positions: [0, 0, 1, 0], covariance: { variable: [1], upper: [4, 1, 9] } }],
  });

  test("holds a plan's covariances as those of space, and unknown classes as other", async () => {
    const graph = await decodeGraph(small(), 0);
    expect([...graph.estimates[0].covariance!.upper]).toEqual([4, 1, 0, 9, 0, 0]);
    expect(graph.edges.class[0]).toBe(5);
  });

  test("with an edge to nowhere is refused", async () => {
    const wrong = small();
    wrong.edges.b = [2];
    await expect(decodeGraph(wrong, 0)).rejects.toThrow("graph 1, edges, b: entry 0 is 2");
  });
});
