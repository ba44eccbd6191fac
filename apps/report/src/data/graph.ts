// SPDX-License-Identifier: BSD-3-Clause
// A graph as the page works with it: typed arrays, checked.
import type { Column, EdgesJson, EstimateJson, GraphJson, Role, RunJson, VariablesJson } from "./contract";
import { DataError, decodeBytes, decodeFloats, decodeIndices, decodeNumbers, decodePositions } from "./decode";
import { Ids } from "./ids";
import { Recording } from "./recording";

export const EdgeClass = { odometry: 0, loop: 1, landmark: 2, prior: 3, path: 4, other: 5 } as const;
export const kEdgeClassNames = ["odometry", "loop closure", "landmark", "prior", "path", "other"];

export interface NumberColumn {
  name: string;
  unit: string;
  values: ArrayLike<number | bigint>;
}

export interface Variables {
  count: number;
  ids: Ids;
  types: { name: string; role: "pose" | "landmark" }[];
  type: Uint8Array;
  fixed: Set<number>;
  columns: NumberColumn[];
}

export interface Edges {
  count: number;
  a: Int32Array;
  b: Int32Array;
  class: Uint8Array;
  types: { name: string; residualSize: number }[];
  type: Uint8Array;
  factor: Int32Array | null;
  columns: NumberColumn[];
}

/** Whether the edge is the first of its factor, and of its class: a factor on many variables has several edges, one after another. */
export function countsOnce(edges: Edges, e: number): boolean {
  return !edges.factor || e === 0 || edges.factor[e] !== edges.factor[e - 1] || edges.class[e] !== edges.class[e - 1];
}

/** How many factors the edges are of, or how many edges where they are of none. */
export function factorCount(edges: Edges): number {
  return edges.factor ? new Set(edges.factor).size : edges.count;
}

/** Of some variables' positions: xx xy xz yy yz zz [m²], also in 2D. */
export interface Covariance {
  variable: Int32Array;
  upper: Float32Array;
}

export interface Estimate {
  name: string;
  role: Role;
  file: string;
  run: number;
  /** x y z of each variable [m], relative to the graph's origin; NaN: not there. */
  positions: Float32Array;
  orientation: Float32Array | null;
  edgeChi2: Float32Array | null;
  chi2: number | null;
  covariance: Covariance | null;
}

export interface Graph {
  name: string;
  comment: string;
  dimension: 2 | 3;
  origin: [number, number, number];
  variables: Variables;
  edges: Edges;
  estimates: Estimate[];
  runs: RunJson[];
  recordings: Recording[];
}

async function decodeColumns(columns: Column[] | undefined, count: number, where: string): Promise<NumberColumn[]> {
  return Promise.all(
    (columns ?? []).map(async (column) => ({
      name: String(column.name),
      unit: String(column.unit ?? ""),
      values: await decodeNumbers(column.values, `${where}, column ${column.name}`, count),
    })),
  );
}

async function types(array: VariablesJson["type"], count: number, offered: number, where: string) {
  if (array === undefined) return new Uint8Array(count);
  const all = await decodeBytes(array, where, count);
  for (const type of all) if (type >= offered) throw new DataError(`${where}: type ${type} of ${offered}`);
  return all;
}

async function decodeVariables(json: VariablesJson, where: string): Promise<Variables> {
  if (!json || !Number.isInteger(json.count) || json.count < 0) throw new DataError(`${where}: no count`);
  const offered = (json.types ?? [{ name: "variable" }]).map((type) => ({
    name: String(type.name),
    role: type.role === "landmark" ? ("landmark" as const) : ("pose" as const),
  }));
  return {
    count: json.count,
    ids: await Ids.decode(json.ids ?? "sequence", json.count, `${where}, ids`),
    types: offered,
    type: await types(json.type, json.count, offered.length, `${where}, type`),
    fixed: new Set((json.fixed ?? []).filter((i) => Number.isInteger(i))),
    columns: await decodeColumns(json.columns, json.count, where),
  };
}

async function decodeEdges(json: EdgesJson | undefined, variables: number, where: string): Promise<Edges> {
  const edges = json ?? { count: 0, a: [], b: [], class: [] };
  const offered = (edges.types ?? [{ name: "factor" }]).map((type) => ({
    name: String(type.name),
    residualSize: Number(type.residual_size ?? 0),
  }));
  return {
    count: edges.count,
    a: await decodeIndices(edges.a, `${where}, a`, 0, variables, edges.count),
    b: await decodeIndices(edges.b, `${where}, b`, -1, variables, edges.count),
    class: (await decodeBytes(edges.class, `${where}, class`, edges.count)).map((c) => Math.min(c, EdgeClass.other)),
    types: offered,
    type: await types(edges.type, edges.count, offered.length, `${where}, type`),
    factor: edges.factor ? await decodeIndices(edges.factor, `${where}, factor`, 0, 2 ** 31 - 1, edges.count) : null,
    columns: await decodeColumns(edges.columns, edges.count, where),
  };
}

async function decodeCovariance(
  json: EstimateJson["covariance"], dimension: 2 | 3, variables: number, where: string,
): Promise<Covariance | null> {
  if (!json) return null;
  const variable = await decodeIndices(json.variable, `${where}, variable`, 0, variables);
  const size = dimension === 2 ? 3 : 6;
  const upper = await decodeFloats(json.upper, `${where}, upper`, variable.length * size);
  if (dimension === 3) return { variable, upper };
  const spatial = new Float32Array(6 * variable.length);
  for (let k = 0; k < variable.length; ++k) {
    spatial[6 * k] = upper[3 * k];
    spatial[6 * k + 1] = upper[3 * k + 1];
    spatial[6 * k + 3] = upper[3 * k + 2];
  }
  return { variable, upper: spatial };
}

const kRoles: Role[] = ["initial", "estimate", "truth", "peer"];

async function decodeEstimate(
  json: EstimateJson, dimension: 2 | 3, variables: number, edges: number, where: string,
): Promise<Estimate> {
  const turn = dimension === 2 ? 1 : 4;
  return {
    name: String(json.name ?? "estimate"),
    role: kRoles.includes(json.role as Role) ? (json.role as Role) : "estimate",
    file: String(json.file ?? ""),
    run: Number.isInteger(json.run) ? (json.run as number) : -1,
    positions: await decodePositions(json.positions, dimension, variables, `${where}, positions`),
    orientation: json.orientation
      ? await decodeFloats(json.orientation, `${where}, orientation`, turn * variables) : null,
    edgeChi2: json.edge_chi2 ? await decodeFloats(json.edge_chi2, `${where}, edge_chi2`, edges) : null,
    chi2: typeof json.chi2 === "number" ? json.chi2 : null,
    covariance: await decodeCovariance(json.covariance, dimension, variables, `${where}, covariance`),
  };
}

export async function decodeGraph(json: GraphJson, number: number): Promise<Graph> {
  const name = String(json.name ?? `graph ${number + 1}`);
  const where = `graph ${number + 1}`;
  const dimension = json.dimension === 2 ? 2 : 3;
  const variables = await decodeVariables(json.variables, `${where}, variables`);
  const edges = await decodeEdges(json.edges, variables.count, `${where}, edges`);
  const estimates: Estimate[] = [];
  for (const [k, estimate] of (json.estimates ?? []).entries()) {
    estimates.push(
      await decodeEstimate(estimate, dimension, variables.count, edges.count, `${where}, estimate ${k + 1}`));
  }
  const recordings: Recording[] = [];
  for (const [k, recording] of (json.recordings ?? []).entries()) {
    recordings.push(await Recording.decode(
      recording, dimension, variables.count, edges.count, `${where}, recording ${k + 1}`));
  }
  if (estimates.length === 0 && recordings.length === 0) throw new DataError(`${where}: no estimate`);
  const [x = 0, y = 0, z = 0] = json.origin ?? [];
  return {
    name, comment: String(json.comment ?? ""), dimension, origin: [x, y, z],
    variables, edges, estimates, runs: json.runs ?? [], recordings,
  };
}
