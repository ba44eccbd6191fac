// SPDX-License-Identifier: BSD-3-Clause
// Numbers as people read them.

export const kNone = "–";

const isNumber = (x: unknown): x is number => typeof x === "number" && Number.isFinite(x);

/** 12345 → "12 345", with a thin space that does not break. */
export function count(n: number | null | undefined): string {
  return isNumber(n) ? String(Math.round(n)).replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f") : kNone;
}

/** `digits` significant ones; an exponent only for what is very large or very small. */
export function number(x: number | null | undefined, digits = 5): string {
  if (!isNumber(x)) return kNone;
  if (x === 0) return "0";
  const magnitude = Math.abs(x);
  if (magnitude >= 10 ** Math.max(6, digits + 1) || magnitude < 1e-4) return exponent(x, Math.min(digits - 1, 2));
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(magnitude)));
  return x.toFixed(Math.min(decimals, 12)).replace("-", "−");
}

function exponent(x: number, decimals: number): string {
  const [mantissa, power] = x.toExponential(decimals).split("e");
  const raised = power.replace("+", "").replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)]));
  return `${Number(mantissa) === 1 ? "" : `${mantissa.replace("-", "−")}\u200a×\u200a`}10${raised}`;
}

/** A mark on a logarithmic axis: 10⁻³, or 2 × 10⁻³; plain between 0.01 and 9999. */
export function logLabel(x: number): string {
  if (x >= 0.00999 && x < 10000) return String(Number(x.toPrecision(3)));
  const power = Math.floor(Math.log10(x) + 1e-9);
  const mantissa = Math.round(x / 10 ** power);
  const raised = String(power).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)]));
  return mantissa === 1 ? `10${raised}` : `${mantissa}×10${raised}`;
}

export function seconds(s: number | null | undefined): string {
  if (!isNumber(s)) return kNone;
  if (s === 0) return "0 s";
  if (s < 1e-3) return `${number(s * 1e6, 3)} µs`;
  if (s < 1) return `${number(s * 1e3, 3)} ms`;
  if (s < 120) return `${number(s, 3)} s`;
  return `${Math.floor(s / 60)} min ${Math.round(s % 60)} s`;
}

export function bytes(n: number | null | undefined): string {
  if (!isNumber(n) || n <= 0) return kNone;
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  const k = Math.min(units.length - 1, Math.floor(Math.log2(n) / 10));
  return `${number(n / 1024 ** k, 3)} ${units[k]}`;
}

export function metres(x: number): string {
  return Number.isFinite(x) ? x.toFixed(Math.abs(x) >= 1e5 ? 2 : 3).replace("-", "−") : kNone;
}

/** File names without their folders, where that leaves them apart. */
export function shortNames(files: string[]): string[] {
  const names = files.map((file) => file.replace(/[/\\]+$/, "").split(/[/\\]/).pop() || file);
  return new Set(names).size === new Set(files).size ? names : files;
}

/** What to call each graph of a report: the name that it gives, else that of the file. */
export function graphNames(graphs: { file: string; name?: string }[]): string[] {
  const files = shortNames(graphs.map(({ file }) => file));
  return graphs.map(({ name }, k) => name || files[k]);
}

export function plural(n: number, one: string, many = `${one}s`): string {
  return `${count(n)} ${n === 1 ? one : many}`;
}
