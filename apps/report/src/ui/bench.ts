// SPDX-License-Identifier: BSD-3-Clause
// The comparison of solvers.
import type { BenchJson, ConfigurationJson } from "../data/contract";
import { barChart, type Bar } from "./bars";
import { lineChart } from "./chart";
import { el, freshId } from "./dom";
import { bytes, count, graphNames, kNone, number, plural, seconds } from "./format";
import { statusText } from "./runs";
import { chi2Line } from "./series";
import { table, type Cell } from "./table";

const isNumber = (x: unknown): x is number => typeof x === "number" && Number.isFinite(x);

/** What tells a configuration from the others of its graph: without the optimizer where all have the same. */
export function configurationNames(all: ConfigurationJson[]): string[] {
  const linear = (c: ConfigurationJson) => (c.linear_solver && c.linear_solver !== "-" ? c.linear_solver : "");
  const oneOptimizer = new Set(all.map((c) => c.optimizer)).size === 1;
  const distinct = new Set(all.map(linear)).size === all.length && !all.some((c) => !linear(c));
  if (oneOptimizer && distinct) return all.map(linear);
  return all.map((c) => [c.optimizer, linear(c)].filter(Boolean).join(", "));
}

function agreement(c: ConfigurationJson): Cell {
  const excess = c.chi2?.relative_difference;
  if (!c.chi2 || !isNumber(excess)) return { text: kNone };
  const text = excess === 0 ? "lowest" : `+${excess.toExponential(1).replace("-", "−")}`;
  return c.chi2.agrees === false
    ? { text: `${text} ✗`, class: "notable", about: "more than one part in a million above the lowest" }
    : { text: `${text} ✓`, about: "agrees with the lowest to one part in a million" };
}

function graphTable(title: string, all: ConfigurationJson[]): HTMLElement {
  const rows = all.map((c): Cell[] => {
    const failed = c.error || !c.seconds;
    return [
      c.optimizer, c.linear_solver ?? kNone,
      seconds(c.seconds?.median),
      failed ? kNone : `${seconds(c.seconds?.min)} … ${seconds(c.seconds?.max)}`,
      isNumber(c.ratio) ? c.ratio.toFixed(2) : kNone,
      isNumber(c.seconds?.per_iteration) ? number(c.seconds.per_iteration * 1e3, 3) : kNone,
      count(c.iterations), number(c.chi2?.final, 8), agreement(c),
      count(c.solver?.factor_nonzeros || null), bytes(c.peak_memory_bytes),
      failed ? { text: c.error ? "failed" : "not run", class: "notable", about: c.error ?? "" }
        : { text: c.runs?.some((run) => run.out_of_time) ? "time limit" : statusText(c.status), class: c.status === "converged" ? "" : "notable" },
    ];
  });
  return table(title, [
    { title: "optimizer", left: true }, { title: "linear solver", left: true },
    { title: "median", about: "of optimisation alone, over the rounds" }, { title: "min … max" },
    { title: "ratio", about: "median over the rounds of the time against the first line's in the same round" },
    { title: "ms an iteration" }, { title: "iterations" }, { title: "χ²" },
    { title: "above lowest", about: "relative to the lowest χ² of all" },
    { title: "nnz(L)", about: "numbers in the factor of H" }, { title: "memory", about: "peak of a process that reads and optimises once" },
    { title: "ended", left: true },
  ], rows, 2);
}

function timeBars(all: ConfigurationJson[], names: string[]): Bar[] {
  return all.flatMap((c, k) => isNumber(c.seconds?.median) ? [{
    name: names[k], value: c.seconds.median,
    low: isNumber(c.seconds.min) ? c.seconds.min : undefined, high: isNumber(c.seconds.max) ? c.seconds.max : undefined,
    text: seconds(c.seconds.median),
  }] : []);
}

/** Values and a unit in which they are easy to read. */
function scaled(bars: Bar[], units: [number, string][]): { bars: Bar[]; unit: string } {
  const most = Math.max(...bars.map((bar) => bar.value));
  const [factor, unit] = units.find(([one]) => most >= one) ?? units[units.length - 1];
  const scale = (x: number | undefined) => (x === undefined ? undefined : x / factor);
  return { unit, bars: bars.map((bar) => ({ ...bar, value: bar.value / factor, low: scale(bar.low), high: scale(bar.high) })) };
}

function graphSection(entry: BenchJson["graphs"][number], title: string): HTMLElement {
  const all = entry.configurations;
  const names = configurationNames(all);
  const { graph } = entry;
  const id = freshId("graph");
  const barCharts: HTMLElement[] = [];
  const charts: HTMLElement[] = [];
  const times = timeBars(all, names);
  if (times.length > 0) {
    const { bars, unit } = scaled(times, [[1, "time [s]"], [1e-3, "time [ms]"], [1e-6, "time [µs]"]]);
    barCharts.push(barChart("Time", "Median time of optimisation; whiskers from the fastest round to the slowest.", unit, bars));
  }
  const memory = all.flatMap((c, k): Bar[] => isNumber(c.peak_memory_bytes) && c.peak_memory_bytes > 0
    ? [{ name: names[k], value: c.peak_memory_bytes, text: bytes(c.peak_memory_bytes) }] : []);
  const histories = all.map((c, k) => ({ c, name: names[k] })).filter(({ c }) => (c.history?.length ?? 0) > 0);
  if (histories.length > 0) {
    charts.push(lineChart({
      title: "Convergence", caption: "χ² (sum of squared whitened residuals, no unit) over the time of the median round",
      xLabel: "time [s]", yLabel: "χ²", logarithmic: true, xText: seconds,
      lines: histories.map(({ c, name }) => chi2Line(name, c.chi2?.initial, c.history!, "time")),
    }));
  }
  if (memory.length > 0) {
    const { bars, unit } = scaled(memory, [[2 ** 30, "memory [GiB]"], [2 ** 20, "memory [MiB]"], [1, "memory [B]"]]);
    barCharts.push(barChart("Memory", "Peak memory of a process that reads the graph and optimises once.", unit, bars));
  }
  const errors = all.filter((c) => c.error).map((c) => el("li", {}, `${c.optimizer} ${c.linear_solver ?? ""} failed: ${String(c.error)}`));
  const notes = all.flatMap((c, k) => (c.notes ?? []).map((note) => el("li", {}, `${names[k]}: ${String(note)}`)));
  return el("section", { class: "bench-graph", "aria-labelledby": id },
    el("h2", { id, title: graph.file }, title),
    el("p", { class: "lead" }, `${plural(graph.variables ?? 0, "variable")}, ${plural(graph.factors ?? 0, "factor")}` +
      (isNumber(graph.tangent_size) ? `; ${count(graph.tangent_size)} unknowns, ${count(graph.residual_size)} residuals` : "")),
    graphTable(title, all),
    errors.length + notes.length > 0 ? el("ul", { class: "notes" }, ...errors, ...notes) : null,
    el("div", { class: "charts" }, barCharts.length > 0 ? el("div", { class: "stack" }, ...barCharts) : null, ...charts));
}

/** Ratios of all graphs at a glance. */
function overview(bench: BenchJson): HTMLElement | null {
  if (bench.graphs.length < 2) return null;
  const names: string[] = [];
  for (const { configurations } of bench.graphs) {
    for (const name of fullNames(configurations)) if (!names.includes(name)) names.push(name);
  }
  const titles = graphNames(bench.graphs.map(({ graph }) => graph));
  const rows = bench.graphs.map(({ graph, configurations }, g): Cell[] => {
    const own = fullNames(configurations);
    const fastest = Math.min(...configurations.map((c) => (isNumber(c.ratio) ? c.ratio : Infinity)));
    return [{ text: titles[g], about: graph.file }, ...names.map((name): Cell => {
      const c = configurations[own.indexOf(name)];
      if (!c || !isNumber(c.ratio)) return kNone;
      const wrong = c.chi2?.agrees === false;
      return { text: c.ratio.toFixed(2) + (wrong ? " ✗" : ""), class: wrong ? "notable" : c.ratio === fastest ? "best" : "",
        about: wrong ? "ends above the lowest chi2" : c.ratio === fastest ? "the fastest" : "" };
    })];
  });
  return el("section", {}, el("h2", {}, "Time against the first, by graph"),
    el("p", { class: "lead" }, "Median over the rounds of the ratio of times in the same round; below 1 is faster. Bold: the fastest. ✗: ended above the lowest χ²."),
    table("Ratios", [{ title: "graph", left: true }, ...names.map((title) => ({ title }))], rows));
}

function fullNames(all: ConfigurationJson[]): string[] {
  return all.map((c) => [c.optimizer, c.linear_solver === "-" ? "" : c.linear_solver].filter(Boolean).join(", "));
}

export function benchView(bench: BenchJson): HTMLElement {
  const { machine, build } = bench;
  const titles = graphNames(bench.graphs.map(({ graph }) => graph));
  const facts: [string, string][] = [
    ["machine", [machine?.cpu, isNumber(machine?.cores) ? plural(machine.cores, "core") : ""].filter(Boolean).join(", ")],
    ["build", ["cairn " + (bench.cairn ?? ""), build?.compiler, build?.flags, build?.simd].filter(Boolean).join(", ")],
    ["rounds", `${count(bench.repeat)}, with ${plural(bench.threads ?? 1, "thread")}; in each round every solver runs once, in turns`],
    ["stops", `after ${count(bench.max_iterations)} iterations, or when χ² would fall by less than ${number(bench.tolerance)} of it`],
    ["start", [bench.initial ? `initial guess: ${bench.initial}` : "", bench.loss ? `loss: ${bench.loss}` : ""].filter(Boolean).join("; ")],
  ];
  return el("div", { class: "page" },
    el("h1", {}, "Comparison of solvers"),
    bench.interrupted ? el("p", { class: "warning" }, "Interrupted: these are the runs that were complete by then.") : null,
    el("dl", { class: "facts" }, ...facts.filter(([, text]) => text).flatMap(([name, text]) => [el("dt", {}, name), el("dd", {}, text)])),
    overview(bench),
    ...bench.graphs.map((entry, g) => graphSection(entry, titles[g])));
}
