// SPDX-License-Identifier: BSD-3-Clause
import type { ReportJson } from "../data/contract";
import type { Exploration } from "../data/exploration";
import type { Graph } from "../data/graph";
import { el } from "./dom";
import { count } from "./format";

const kKeys: [string, string][] = [
  ["drag", "turn (3D), move (2D)"], ["shift + drag, right button", "move"], ["wheel, two fingers", "nearer, farther"],
  ["← → ↑ ↓", "turn (3D), move (2D); with shift: move"], ["+  −", "nearer, farther"], ["F", "show all"],
  ["[  ]", "one recorded frame back, on"], ["space", "play, pause"], ["Esc", "no longer mark"],
];

function facts(rows: [string, string | undefined | null][]): HTMLElement {
  return el("dl", { class: "facts" }, ...rows.flatMap(([name, text]) => (text ? [el("dt", {}, name), el("dd", {}, text)] : [])));
}

export function aboutView(report: ReportJson, graphs: Graph[], explorations: Exploration[], renderer: string): HTMLElement {
  const { machine, build } = report;
  return el("div", { class: "page narrow" },
    el("h1", {}, report.title || "cairn"),
    facts([
      ["made by", `cairn ${report.cairn ?? ""}`], ["command", report.command], ["on", report.created],
      ["machine", [machine?.cpu, machine?.cores ? `${machine.cores} cores` : ""].filter(Boolean).join(", ")],
      ["build", [build?.compiler, build?.flags, build?.simd].filter(Boolean).join(", ")],
      ["drawn by", renderer],
    ]),
    report.notes?.length ? el("ul", { class: "notes" }, ...report.notes.map((note) => el("li", {}, String(note)))) : null,
    ...graphs.map((graph) => el("section", {},
      el("h2", {}, graph.name),
      graph.comment ? el("p", { class: "comment" }, graph.comment) : null,
      facts([
        ["variables", graph.variables.types.map((type, k) => `${type.name} ${count(countOf(graph.variables.type, k))}`).join(", ")],
        ["edges", graph.edges.types.map((type, k) => `${type.name} ${count(countOf(graph.edges.type, k))}`).join(", ")],
        ...graph.estimates.map((estimate): [string, string] => [estimate.name, estimate.file]),
      ]))),
    ...explorations.map(({ name, header, notes }) => el("section", {},
      el("h2", {}, name),
      facts([
        ["floor", header.floor], ["seed", header.seed === undefined ? null : String(header.seed)],
        ...Object.entries(header.parts ?? {}).map(([kind, part]): [string, string] => [kind, String(part)]),
      ]),
      notes.length > 0 ? el("ul", { class: "notes" }, ...notes.map((note) => el("li", {}, note))) : null)),
    graphs.length + explorations.length > 0 ? el("section", {}, el("h2", {}, "Keys and pointer"), facts(kKeys)) : null);
}

function countOf(types: Uint8Array, type: number): number {
  let n = 0;
  for (const t of types) n += t === type ? 1 : 0;
  return n;
}
