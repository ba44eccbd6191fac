// SPDX-License-Identifier: BSD-3-Clause
// What there is to say about a variable or an edge.
import { kEdgeClassNames, type Graph, type NumberColumn } from "../data/graph";
import type { Drawing } from "../draw/drawing";
import { halfAxes } from "../draw/ellipses";
import type { Hit, ViewState } from "../draw/state";
import { el } from "./dom";
import { metres, number } from "./format";

export interface Facts {
  title: string;
  subtitle: string;
  rows: [string, string][];
}

export function edgeName(graph: Graph, e: number): string {
  const { a, b } = graph.edges;
  const ids = graph.variables.ids;
  return b[e] < 0 ? ids.label(a[e]) : `${ids.label(a[e])} → ${ids.label(b[e])}`;
}

function degrees(radians: number): string {
  return `${number((radians * 180) / Math.PI, 4)}°`;
}

function columnRows(columns: NumberColumn[], k: number): [string, string][] {
  const rows: [string, string][] = [];
  for (const column of columns) {
    const value = Number(column.values[k]);
    if (Number.isFinite(value)) rows.push([column.name, `${number(value, 6)}${column.unit ? ` ${column.unit}` : ""}`]);
  }
  return rows;
}

function positionText(graph: Graph, xyz: Float32Array, i: number): string {
  const all = [0, 1, 2].slice(0, graph.dimension).map((d) => metres(xyz[3 * i + d] + graph.origin[d]));
  return `${all.join("  ")} m`;
}

function orientationText(graph: Graph, turns: Float32Array, i: number): string | null {
  if (graph.dimension === 2) return Number.isFinite(turns[i]) ? degrees(turns[i]) : null;
  const [x, y, z, w] = turns.subarray(4 * i, 4 * i + 4);
  if (!Number.isFinite(w)) return null;
  const roll = Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y));
  const pitch = Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - z * x))));
  const yaw = Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
  return [roll, pitch, yaw].map(degrees).join("  ");
}

function variableFacts(drawing: Drawing, state: ViewState, hit: Hit): Facts {
  const { graph } = drawing;
  const { variables } = graph;
  const i = hit.index;
  const estimate = graph.estimates[hit.estimate];
  const recorded = state.recording >= 0 && hit.estimate === state.focus;
  const rows: [string, string][] = [["position", positionText(graph, drawing.positions(state, hit.estimate), i)]];
  const turn = !recorded && estimate?.orientation ? orientationText(graph, estimate.orientation, i) : null;
  if (turn) rows.push([graph.dimension === 2 ? "heading" : "roll pitch yaw", turn]);
  const covariance = recorded ? null : estimate?.covariance;
  const k = covariance ? covariance.variable.indexOf(i) : -1;
  const axes = covariance && k >= 0 ? halfAxes(covariance.upper, 6 * k) : null;
  if (axes) {
    const sigmas = axes.slice(0, graph.dimension).map((axis) => number(Math.hypot(...axis), 3));
    rows.push(["σ along axes", `${sigmas.join("  ")} m`]);
  }
  if (variables.fixed.has(i)) rows.push(["held", "fixed"]);
  rows.push(...columnRows(variables.columns, i));
  const name = recorded ? graph.recordings[state.recording].name : (estimate?.name ?? "");
  return { title: variables.ids.label(i), subtitle: variables.types[variables.type[i]]?.name ?? "", rows: [...rows, ["estimate", name]] };
}

function edgeFacts(drawing: Drawing, state: ViewState, hit: Hit): Facts {
  const { graph } = drawing;
  const { edges } = graph;
  const e = hit.index;
  const type = edges.types[edges.type[e]];
  const rows: [string, string][] = [["class", kEdgeClassNames[edges.class[e]]]];
  const chi2 = hit.estimate === state.focus ? drawing.chi2(state) : (graph.estimates[hit.estimate]?.edgeChi2 ?? null);
  if (chi2 && Number.isFinite(chi2[e])) {
    const size = type?.residualSize ? `  (${type.residualSize} expected)` : "";
    rows.push(["chi2", `${number(chi2[e], 4)}${size}`]);
  }
  if (edges.b[e] >= 0) {
    const xyz = drawing.positions(state, hit.estimate);
    const i = 3 * edges.a[e], j = 3 * edges.b[e];
    const length = Math.hypot(xyz[i] - xyz[j], xyz[i + 1] - xyz[j + 1], xyz[i + 2] - xyz[j + 2]);
    if (Number.isFinite(length)) rows.push(["length", `${metres(length)} m`]);
  }
  rows.push(["factor", `number ${edges.factor ? edges.factor[e] : e}`]);
  rows.push(...columnRows(edges.columns, e));
  return { title: edgeName(graph, e), subtitle: type?.name ?? "", rows };
}

export function facts(drawing: Drawing, state: ViewState, hit: Hit): Facts {
  return hit.kind === "variable" ? variableFacts(drawing, state, hit) : edgeFacts(drawing, state, hit);
}

export function factsElement(all: Facts): DocumentFragment {
  const fragment = document.createDocumentFragment();
  fragment.append(
    el("div", { class: "facts-title" }, el("strong", {}, all.title), el("span", {}, all.subtitle)),
    el("dl", {}, ...all.rows.flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)])),
  );
  return fragment;
}
