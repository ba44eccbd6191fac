// SPDX-License-Identifier: BSD-3-Clause
// Arrays of numbers out of the JSON. Everything throws `DataError` with where and what was expected.
import type { NumberArray, NumberType, PackedArray, Positions } from "./contract";

export class DataError extends Error {}

export type Numbers = Float32Array | Float64Array | Int32Array | BigInt64Array | Uint8Array | Uint16Array;

const kBytes: Record<NumberType, number> = { f32: 4, f64: 8, i32: 4, i64: 8, u8: 1, u16: 2 };

/** The bytes of base64 text (RFC 4648, standard alphabet). */
export function bytesOfBase64(text: string): Uint8Array<ArrayBuffer> {
  const modern = Uint8Array as unknown as { fromBase64?: (text: string) => Uint8Array<ArrayBuffer> };
  if (modern.fromBase64) return modern.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let k = 0; k < binary.length; ++k) bytes[k] = binary.charCodeAt(k);
  return bytes;
}

async function inflate(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function bytesOf(packed: PackedArray, where: string): Promise<Uint8Array<ArrayBuffer>> {
  try {
    if (typeof packed.base64 === "string") return bytesOfBase64(packed.base64);
    if (typeof packed.deflate === "string") return await inflate(bytesOfBase64(packed.deflate));
  } catch {
    throw new DataError(`${where}: the packed numbers cannot be read`);
  }
  throw new DataError(`${where}: neither "base64" nor "deflate"`);
}

function view(type: NumberType, bytes: Uint8Array<ArrayBuffer>): Numbers {
  const buffer = bytes.byteOffset % 8 === 0 ? bytes.buffer : bytes.slice().buffer;
  const offset = bytes.byteOffset % 8 === 0 ? bytes.byteOffset : 0;
  const count = bytes.byteLength / kBytes[type];
  switch (type) {
    case "f32": return new Float32Array(buffer, offset, count);
    case "f64": return new Float64Array(buffer, offset, count);
    case "i32": return new Int32Array(buffer, offset, count);
    case "i64": return new BigInt64Array(buffer, offset, count);
    case "u8": return new Uint8Array(buffer, offset, count);
    case "u16": return new Uint16Array(buffer, offset, count);
  }
}

/** `expected`: how many there must be; leave out where any number will do. */
export async function decodeNumbers(array: NumberArray, where: string, expected?: number): Promise<Numbers> {
  let numbers: Numbers;
  if (Array.isArray(array)) {
    numbers = Float64Array.from(array, (x) => (typeof x === "number" ? x : NaN));
  } else {
    if (typeof array !== "object" || array === null) throw new DataError(`${where}: no array of numbers`);
    if (!Object.hasOwn(kBytes, array.type)) throw new DataError(`${where}: no such type of numbers`);
    const bytes = await bytesOf(array, where);
    if (bytes.length !== array.count * kBytes[array.type]) {
      throw new DataError(`${where}: ${bytes.length} bytes, but ${array.count} numbers of type ${array.type}`);
    }
    numbers = view(array.type, bytes);
  }
  if (expected !== undefined && numbers.length !== expected) {
    throw new DataError(`${where}: ${numbers.length} numbers instead of ${expected}`);
  }
  return numbers;
}

export async function decodeFloats(array: NumberArray, where: string, expected?: number): Promise<Float32Array> {
  const numbers = await decodeNumbers(array, where, expected);
  if (numbers instanceof Float32Array) return numbers;
  return Float32Array.from(numbers as ArrayLike<number>, Number);
}

/** Indices, each at least `low` and below `high`. */
export async function decodeIndices(
  array: NumberArray, where: string, low: number, high: number, expected?: number,
): Promise<Int32Array> {
  const numbers = await decodeNumbers(array, where, expected);
  const indices = numbers instanceof Int32Array ? numbers : Int32Array.from(numbers as ArrayLike<number>, Number);
  for (let k = 0; k < indices.length; ++k) {
    if (indices[k] < low || indices[k] >= high) {
      throw new DataError(`${where}: entry ${k} is ${indices[k]}, not within ${low} … ${high - 1}`);
    }
  }
  return indices;
}

export async function decodeBytes(array: NumberArray, where: string, expected?: number): Promise<Uint8Array> {
  const numbers = await decodeNumbers(array, where, expected);
  return numbers instanceof Uint8Array ? numbers : Uint8Array.from(numbers as ArrayLike<number>, Number);
}

const kMissing16 = 65535;

/** x y z of `count` variables (relative to the graph's origin), whatever the dimension; of one dimension x alone is set. */
export async function decodePositions(
  positions: Positions, dimension: 1 | 2 | 3, count: number, where: string,
): Promise<Float32Array> {
  const raw = await decodeNumbers(positions, where, dimension * count);
  const scale = [1, 1, 1];
  const shift = [0, 0, 0];
  const quantized = raw instanceof Uint16Array;
  if (quantized) {
    const { min, max } = positions as { min?: number[]; max?: number[] };
    if (!Array.isArray(min) || !Array.isArray(max) || min.length < dimension || max.length < dimension) {
      throw new DataError(`${where}: u16 positions without "min" and "max"`);
    }
    for (let d = 0; d < dimension; ++d) {
      shift[d] = min[d];
      scale[d] = (max[d] - min[d]) / (kMissing16 - 1);
    }
  } else if (dimension === 3 && raw instanceof Float32Array) {
    return raw;
  }
  const xyz = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    for (let d = 0; d < dimension; ++d) {
      const value = Number(raw[i * dimension + d]);
      xyz[3 * i + d] = quantized && value === kMissing16 ? NaN : shift[d] + scale[d] * value;
    }
  }
  return xyz;
}
