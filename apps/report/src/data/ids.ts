// SPDX-License-Identifier: BSD-3-Clause
import type { NumberArray } from "./contract";
import { DataError, decodeNumbers } from "./decode";

const kSymbolBits = 45n;

/** As messages of cairn name it: x3 where a letter stands above 45 bits of an index, else the number. */
function idText(id: string | number | bigint): string {
  if (typeof id === "string" || !(id > 0)) return String(id);
  const whole = BigInt(id), code = whole >> kSymbolBits;
  const letter = code < 128n ? String.fromCharCode(Number(code)) : "";
  return /[a-zA-Z]/.test(letter) ? `${letter}${whole - (code << kSymbolBits)}` : String(id);
}

/** The names of variables: numbers of up to 64 bits, any text, or simply 0, 1, 2, … */
export class Ids {
  private index: Map<string, number> | null = null;

  private constructor(
    readonly count: number,
    private readonly names: ArrayLike<string | number | bigint> | null,
  ) {}

  static async decode(json: NumberArray | string[] | "sequence", count: number, where: string): Promise<Ids> {
    if (json === "sequence") return new Ids(count, null);
    if (Array.isArray(json)) {
      if (json.length !== count) throw new DataError(`${where}: ${json.length} instead of ${count}`);
      return new Ids(count, json.map(String));
    }
    return new Ids(count, await decodeNumbers(json, where, count));
  }

  label(variable: number): string {
    return this.names ? idText(this.names[variable]) : String(variable);
  }

  /** The variable of that name, or -1. */
  find(name: string): number {
    const wanted = name.trim();
    if (!this.index) {
      this.index = new Map();
      for (let i = 0; i < this.count; ++i) this.index.set(this.label(i), i);
    }
    return this.index.get(wanted) ?? -1;
  }
}
