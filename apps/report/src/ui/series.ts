// SPDX-License-Identifier: BSD-3-Clause
// Iterations as lines of charts.
import type { IterationJson } from "../data/contract";
import type { Line } from "./chart";

const number = (x: unknown): number | null => (typeof x === "number" && Number.isFinite(x) ? x : null);

/** Seconds since the start, after each iteration. */
export function elapsed(iterations: IterationJson[]): number[] {
  let sum = 0;
  return iterations.map((iteration) => {
    sum += number(iteration.seconds) ?? 0;
    return number(iteration.time) ?? sum;
  });
}

/** chi2 over iterations or time, beginning with what it was at the start. */
export function chi2Line(name: string, initial: unknown, iterations: IterationJson[], over: "iteration" | "time"): Line {
  const start = number(initial);
  const x = over === "iteration" ? iterations.map((_, k) => k + 1) : elapsed(iterations);
  const y = iterations.map((iteration) => number(iteration.chi2));
  return start === null ? { name, x, y } : { name, x: [0, ...x], y: [start, ...y] };
}

export function iterationLine(name: string, iterations: IterationJson[], member: "lambda" | "step_norm"): Line {
  return { name, x: iterations.map((_, k) => k + 1), y: iterations.map((iteration) => number(iteration[member])) };
}
