// SPDX-License-Identifier: BSD-3-Clause
// A robot's exploration as it was recorded, played back to any motion: docs/recording.md.
import type { CandidateJson, ExplorationHeaderJson, ExplorationJson, ExplorationLineJson } from "./contract";
import { DataError, decodeBytes, decodeIndices, decodePositions } from "./decode";
import { Raster, type Cells, type RasterChange } from "./raster";

export type Pose = [x: number, y: number, theta: number];
export type Point = [x: number, y: number];

export interface Scan {
  firstAngle: number;
  angleStep: number;
  maxRange: number;
  /** [m]; NaN: no measurement. */
  ranges: Float32Array;
}

/** The state after a motion, or at the end of the run. */
export interface Moment {
  label: string;
  step: number;
  distance: number;
  estimate: Pose;
  truth: Pose | null;
  /** Of the position of the newest pose that is kept, in the world: xx xy yy [m²]. */
  covariance: [number, number, number] | null;
  coverage: number | null;
  mapEntropy: number | null;
  trajectoryEntropy: number | null;
  kept: number;
  loops: number;
  collisions: number;
  time: number | null;
  scan: Scan | null;
}

export interface Candidate {
  value: number | null;
  what: string;
  length: number | null;
  change: { trajectory: number | null; map: number | null; alpha: number | null } | null;
  points: Point[];
}

export interface Tree {
  /** x y z of each pose [m]. */
  positions: Float32Array;
  parents: Int32Array;
  /** In the first of three places each. */
  values: Float32Array;
}

export interface Decision {
  /** The moment at which it was made. */
  at: number;
  kind: string;
  why: string;
  candidates: Candidate[];
  chosen: number;
  notes: string[];
  tree: Tree | null;
  time: number | null;
}

/** Poses by id, and edges by the number of their factor. */
export interface GraphState {
  poses: Map<number, Pose>;
  edges: Map<number, { a: number; b: number; loop: boolean }>;
}

interface GraphChange {
  poses: number[][];
  removedPoses: number[];
  edges: number[][];
  removedEdges: number[];
}

const finite = (x: unknown): number | null => (typeof x === "number" && Number.isFinite(x) ? x : null);
const numberOr = (x: unknown, otherwise: number): number => finite(x) ?? otherwise;
const kCheckpointEvery = 32;

function decodePose(json: unknown, where: string): Pose {
  if (!Array.isArray(json) || json.length < 3 || json.some((x) => finite(x) === null)) throw new DataError(`${where}: no pose`);
  return [json[0], json[1], json[2]];
}

function decodeRows(json: unknown, size: number, where: string): number[][] {
  if (json === undefined) return [];
  if (!Array.isArray(json)) throw new DataError(`${where}: no list`);
  for (const row of json) {
    if (!Array.isArray(row) || row.length < size || row.some((x) => finite(x) === null)) throw new DataError(`${where}: a row without ${size} numbers`);
  }
  return json as number[][];
}

function decodeCandidate(json: CandidateJson): Candidate {
  const { change } = json;
  const points = (json.points ?? []).filter((p) => Array.isArray(p) && finite(p[0]) !== null && finite(p[1]) !== null);
  return {
    value: finite(json.value), what: String(json.what ?? ""), length: finite(json.length),
    change: change ? { trajectory: finite(change.trajectory), map: finite(change.map), alpha: finite(change.alpha) } : null,
    points: points as Point[],
  };
}

export class Exploration {
  readonly moments: Moment[] = [];
  readonly decisions: Decision[] = [];
  why = "";
  end = "";
  notes: string[] = [];
  readonly map = new Raster();
  private readonly changes: GraphChange[] = [];
  private readonly checkpoints = new Map<number, GraphState>();

  private constructor(readonly name: string, readonly header: ExplorationHeaderJson, public complete: boolean) {}

  static async decode(json: ExplorationJson, number: number): Promise<Exploration> {
    const where = `exploration ${number + 1}`;
    const made = new Exploration(String(json.name ?? where), json.header ?? {}, json.complete === true);
    if (!Array.isArray(json.lines)) throw new DataError(`${where}: no lines`);
    for (const [k, line] of json.lines.entries()) await made.add(line, `${where}, line ${k + 2}`);
    if (made.moments.length === 0) throw new DataError(`${where}: not even the start was recorded`);
    made.map.finish();
    return made;
  }

  /** More lines of a run that goes on. */
  async append(lines: ExplorationLineJson[]): Promise<void> {
    for (const line of lines) await this.add(line, `a further line, after ${this.moments.length} motions`);
    this.map.finish();
  }

  /** The decision that the robot follows, or makes, at moment `k`; null before the first. */
  decisionAt(k: number): Decision | null {
    let found: Decision | null = null;
    for (const decision of this.decisions) {
      if (decision.at > k) break;
      found = decision;
    }
    return found;
  }

  /** The map at moment `k`, good until the next call. */
  cells(k: number): Cells {
    return this.map.at(k);
  }

  /** The graph at moment `k`; not to be changed. */
  graph(k: number): GraphState {
    let from = Math.floor(k / kCheckpointEvery) * kCheckpointEvery;
    while (from >= 0 && !this.checkpoints.has(from)) from -= kCheckpointEvery;
    const saved = this.checkpoints.get(from);
    const state: GraphState = { poses: new Map(saved?.poses), edges: new Map(saved?.edges) };
    for (let i = saved ? from + 1 : 0; i <= k; ++i) {
      this.apply(this.changes[i], state);
      if (i % kCheckpointEvery === 0) this.checkpoints.set(i, { poses: new Map(state.poses), edges: new Map(state.edges) });
    }
    return state;
  }

  private apply(change: GraphChange, state: GraphState): void {
    for (const [id, x, y, theta] of change.poses) state.poses.set(id, [x, y, theta]);
    for (const id of change.removedPoses) state.poses.delete(id);
    for (const [factor, a, b, kind] of change.edges) state.edges.set(factor, { a, b, loop: kind === 1 });
    for (const factor of change.removedEdges) state.edges.delete(factor);
  }

  private async add(line: ExplorationLineJson, where: string): Promise<void> {
    if (typeof line !== "object" || line === null) throw new DataError(`${where}: no object`);
    if (line.step !== undefined) await this.addMotion(line, where);
    else if (line.end !== undefined) await this.addEnd(line, where);
    else await this.addDecision(line, where);
  }

  private async addMotion(line: ExplorationLineJson, where: string): Promise<void> {
    const step = numberOr(line.step, 0);
    const covariance = Array.isArray(line.covariance) && line.covariance.every((x) => finite(x) !== null) ? line.covariance : null;
    this.moments.push({
      label: step === 0 ? "start" : `motion ${step}`, step, distance: numberOr(line.distance, 0),
      estimate: decodePose(line.estimate, `${where}, estimate`),
      truth: line.truth ? decodePose(line.truth, `${where}, truth`) : null,
      covariance: covariance && covariance.length === 3 ? (covariance as [number, number, number]) : null,
      coverage: finite(line.coverage), mapEntropy: finite(line.map_entropy), trajectoryEntropy: finite(line.trajectory_entropy),
      kept: numberOr(line.kept, 0), loops: numberOr(line.loops, 0), collisions: numberOr(line.collisions, 0), time: finite(line.time),
      scan: line.scan ? await decodeScan(line.scan, `${where}, scan`) : null,
    });
    await this.addChanges(line, where);
  }

  /** As one more moment: the last one with what the last solution has moved. */
  private async addEnd(line: ExplorationLineJson, where: string): Promise<void> {
    const last = this.moments.at(-1);
    if (!last) throw new DataError(`${where}: the end before the start`);
    this.end = String(line.end);
    this.complete = true;
    this.why = String(line.why ?? "");
    this.notes = (line.notes ?? []).map(String);
    this.moments.push({ ...last, label: "end", time: finite(line.time) });
    await this.addChanges(line, where);
  }

  private async addChanges(line: ExplorationLineJson, where: string): Promise<void> {
    this.changes.push({
      poses: decodeRows(line.poses, 4, `${where}, poses`),
      removedPoses: (line.removed_poses ?? []).map(Number),
      edges: decodeRows(line.edges, 4, `${where}, edges`),
      removedEdges: (line.removed_edges ?? []).map(Number),
    });
    this.map.add(line.map ? await decodeMap(line.map, `${where}, map`) : null);
  }

  private async addDecision(line: ExplorationLineJson, where: string): Promise<void> {
    if (this.moments.length === 0) throw new DataError(`${where}: a decision before the start`);
    const { tree } = line;
    this.decisions.push({
      at: this.moments.length - 1, kind: String(line.kind ?? ""), why: String(line.why ?? ""),
      candidates: (line.candidates ?? []).map(decodeCandidate),
      chosen: line.kind === "drive" ? numberOr(line.chosen, -1) : -1,
      notes: (line.notes ?? []).map(String), time: finite(line.time),
      tree: tree ? {
        positions: await decodePositions(tree.positions, 2, tree.count, `${where}, tree, positions`),
        parents: await decodeIndices(tree.parents, `${where}, tree, parents`, -1, tree.count, tree.count),
        values: await decodePositions(tree.values, 1, tree.count, `${where}, tree, values`),
      } : null,
    });
  }
}

async function decodeScan(json: NonNullable<ExplorationLineJson["scan"]>, where: string): Promise<Scan> {
  const count = numberOr(json.ranges?.count, 0);
  const xyz = await decodePositions(json.ranges, 1, count, `${where}, ranges`);
  return {
    firstAngle: numberOr(json.first_angle, 0), angleStep: numberOr(json.angle_step, 0), maxRange: numberOr(json.max_range, Infinity),
    ranges: Float32Array.from({ length: count }, (_, i) => xyz[3 * i]),
  };
}

async function decodeMap(json: NonNullable<ExplorationLineJson["map"]>, where: string): Promise<RasterChange> {
  const { x, y, width, height } = json;
  if (![x, y, width, height].every(Number.isInteger) || width < 1 || height < 1) throw new DataError(`${where}: no box of cells`);
  const fresh = json.resolution !== undefined;
  if (fresh && !(numberOr(json.resolution, 0) > 0)) throw new DataError(`${where}: no resolution`);
  return {
    x, y, width, height, cells: await decodeBytes(json.cells, `${where}, cells`, width * height),
    lattice: fresh ? {
      resolution: json.resolution!, origin: [numberOr(json.origin?.[0], 0), numberOr(json.origin?.[1], 0)], yaw: numberOr(json.yaw, 0),
    } : null,
  };
}
