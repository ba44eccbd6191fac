// SPDX-License-Identifier: BSD-3-Clause
// How a graph's runs went.
import type { RunJson } from "../data/contract";
import { factorCount, type Graph } from "../data/graph";
import { lineChart, type Line } from "./chart";
import { el } from "./dom";
import { bytes, count, kNone, number, plural, seconds } from "./format";
import { chi2Line, iterationLine } from "./series";
import { table, type Cell } from "./table";

export function runName(run: RunJson, k: number): string {
  return String(run.name ?? ([run.optimizer, run.linear_solver].filter(Boolean).join(", ") || `run ${k + 1}`));
}

export function statusText(status: string | undefined): string {
  return status ? status.replaceAll("_", " ") : kNone;
}

function runsTable(runs: RunJson[]): HTMLElement {
  const parts = ["linearize", "analyze", "factorize", "solve", "update"] as const;
  const rows = runs.map((run, k): Cell[] => [
    runName(run, k),
    { text: statusText(run.status), class: run.status && run.status !== "converged" ? "notable" : "" },
    count(run.iterations?.length),
    number(run.chi2?.initial, 6), number(run.chi2?.final, 8),
    seconds(run.seconds?.total), ...parts.map((part) => seconds(run.seconds?.[part])),
    count(run.solver?.factor_nonzeros || null), bytes(run.peak_memory_bytes),
  ]);
  return table("Runs", [
    { title: "run", left: true }, { title: "ended", left: true }, { title: "iterations" },
    { title: "χ² at start" }, { title: "χ² at end" }, { title: "total", about: "optimisation alone" },
    ...parts.map((title) => ({ title })), { title: "nnz(L)", about: "numbers in the factor of H" }, { title: "memory", about: "peak of the process" },
  ], rows);
}

/** Everything but the map: charts and table. Null where nothing was run. */
export function runsView(graph: Graph): HTMLElement | null {
  const runs = graph.runs;
  const withIterations = runs.map((run, k) => ({ run, name: runName(run, k) })).filter(({ run }) => (run.iterations?.length ?? 0) > 0);
  const stepLines: Line[] = graph.recordings
    .map((recording) => ({
      name: recording.name,
      x: recording.frames.map((frame, k) => frame.iteration ?? k),
      y: recording.frames.map((frame) => frame.seconds),
    }))
    .filter((line) => line.y.some((y) => y !== null));
  if (runs.length === 0 && stepLines.length === 0) return null;
  const charts: HTMLElement[] = [];
  const lines = (over: "iteration" | "time") => withIterations.map(({ run, name }) => chi2Line(name, run.chi2?.initial, run.iterations!, over));
  if (withIterations.length > 0) {
    charts.push(
      lineChart({
        title: "Convergence", caption: "χ² (sum of squared whitened residuals, no unit) after each iteration",
        xLabel: "iteration", yLabel: "χ²", logarithmic: true, lines: lines("iteration"), xText: count,
      }),
      lineChart({
        title: "Convergence in time", caption: "χ² over seconds of optimisation", xLabel: "time [s]", yLabel: "χ²",
        logarithmic: true, lines: lines("time"), xText: seconds,
      }));
    for (const [member, title, caption, yLabel] of [
      ["lambda", "Damping", "λ of each iteration; runs without damping are left out", "λ"],
      ["step_norm", "Step", "Euclidean norm of each step in the tangent space (metres and radians)", "‖step‖"],
    ] as const) {
      const all = withIterations.map(({ run, name }) => iterationLine(name, run.iterations!, member))
        .filter((line) => line.y.some((y) => y !== null && y > 0));
      if (all.length > 0) charts.push(lineChart({ title, caption, xLabel: "iteration", yLabel, logarithmic: true, lines: all, xText: count, height: 220 }));
    }
  }
  if (stepLines.length > 0) {
    charts.push(lineChart({
      title: "Time a step", caption: "Seconds that each recorded step took", xLabel: "step", yLabel: "time [s]",
      logarithmic: true, lines: stepLines, xText: count,
    }));
  }
  const notes = runs.flatMap((run, k) => (run.notes ?? []).map((note) => `${runName(run, k)}: ${String(note)}`));
  return el("div", { class: "page" },
    el("h1", {}, graph.name),
    el("p", { class: "lead" }, `${plural(graph.variables.count, "variable")}, ${plural(factorCount(graph.edges), "edge")}, ${graph.dimension}D`),
    runs.length > 0 ? runsTable(runs) : null,
    notes.length > 0 ? el("ul", { class: "notes" }, ...notes.map((note) => el("li", {}, note))) : null,
    el("div", { class: "charts" }, ...charts));
}
