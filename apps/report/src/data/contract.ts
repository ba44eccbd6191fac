// SPDX-License-Identifier: BSD-3-Clause
// The JSON that the program puts into the page: docs/report.md, in types. Nothing here is trusted:
// `decode.ts` checks what the page relies on.

export type NumberType = "f32" | "f64" | "i32" | "i64" | "u8" | "u16";

export interface PackedArray {
  type: NumberType;
  count: number;
  base64?: string;
  deflate?: string;
}
export type NumberArray = PackedArray | (number | null)[];

export interface PackedPositions extends PackedArray {
  min?: number[];
  max?: number[];
}
export type Positions = PackedPositions | (number | null)[];

export interface Column {
  name: string;
  unit?: string;
  values: NumberArray;
}

export interface VariablesJson {
  count: number;
  ids?: NumberArray | string[] | "sequence";
  types?: { name: string; role?: "pose" | "landmark" }[];
  type?: NumberArray;
  fixed?: number[];
  columns?: Column[];
}

export interface EdgesJson {
  count: number;
  a: NumberArray;
  b: NumberArray;
  class: NumberArray;
  types?: { name: string; residual_size?: number }[];
  type?: NumberArray;
  factor?: NumberArray;
  columns?: Column[];
}

export type Role = "initial" | "estimate" | "truth" | "peer";

export interface EstimateJson {
  name: string;
  role?: Role;
  file?: string;
  run?: number;
  positions: Positions;
  orientation?: NumberArray;
  edge_chi2?: NumberArray;
  chi2?: number | null;
  covariance?: { variable: NumberArray; upper: NumberArray };
}

export interface IterationJson {
  chi2: number | null;
  step_norm?: number | null;
  lambda?: number | null;
  accepted?: boolean;
  seconds?: number | null;
  time?: number | null;
}

export interface SecondsJson {
  total?: number | null;
  linearize?: number | null;
  analyze?: number | null;
  factorize?: number | null;
  solve?: number | null;
  update?: number | null;
}

export interface RunJson {
  name?: string;
  optimizer?: string;
  linear_solver?: string;
  threads?: number;
  status?: string;
  chi2?: { initial?: number | null; final?: number | null };
  iterations?: IterationJson[];
  seconds?: SecondsJson;
  solver?: { ordering?: string; factor_nonzeros?: number; factor_flops?: number };
  peak_memory_bytes?: number | null;
  notes?: string[];
}

export interface FrameJson {
  label?: string;
  iteration?: number | null;
  time?: number | null;
  chi2?: number | null;
  variables?: number;
  edges?: number;
  changed?: NumberArray;
  positions: Positions;
  edge_chi2?: NumberArray;
  seconds?: number | null;
}

export interface RecordingJson {
  name?: string;
  kind?: "iterations" | "time";
  frames: FrameJson[];
}

export interface GraphJson {
  name?: string;
  comment?: string;
  dimension?: 2 | 3;
  origin?: number[];
  variables: VariablesJson;
  edges?: EdgesJson;
  estimates: EstimateJson[];
  runs?: RunJson[];
  recordings?: RecordingJson[];
}

export interface ConfigurationJson {
  optimizer: string;
  linear_solver?: string;
  error?: string | null;
  status?: string;
  chi2?: { initial?: number | null; final?: number | null; relative_difference?: number | null; agrees?: boolean };
  iterations?: number;
  seconds?: { median?: number | null; min?: number | null; max?: number | null; per_iteration?: number | null };
  ratio?: number | null;
  solver?: { ordering?: string; factor_nonzeros?: number; factor_flops?: number; note?: string };
  notes?: string[];
  peak_memory_bytes?: number | null;
  runs?: { status?: string; out_of_time?: boolean; seconds?: SecondsJson }[];
  history?: IterationJson[];
}

export interface Machine {
  cpu?: string;
  cores?: number;
}
export interface Build {
  compiler?: string;
  flags?: string;
  simd?: string;
}

export interface BenchJson {
  cairn?: string;
  threads?: number;
  repeat?: number;
  initial?: string | null;
  loss?: string | null;
  max_iterations?: number;
  tolerance?: number;
  interrupted?: boolean;
  machine?: Machine;
  build?: Build;
  graphs: {
    graph: { file: string; name?: string; variables?: number; factors?: number; residual_size?: number; tangent_size?: number };
    configurations: ConfigurationJson[];
  }[];
}

/** Lines of a recording of an exploration: docs/recording.md. */
export interface ExplorationHeaderJson {
  name?: string;
  floor?: string;
  parts?: Record<string, string>;
  seed?: number;
  robot?: { radius?: number; lidar?: { range?: number } };
}

export interface MapChangeJson {
  resolution?: number;
  origin?: number[];
  yaw?: number;
  x: number;
  y: number;
  width: number;
  height: number;
  cells: NumberArray;
}

export interface CandidateJson {
  value?: number | null;
  what?: string;
  length?: number | null;
  change?: { trajectory?: number | null; map?: number | null; alpha?: number | null };
  points?: number[][];
  look_at?: number[];
}

export interface ExplorationLineJson {
  step?: number;
  decision?: number;
  end?: string;
  time?: number;
  distance?: number | null;
  estimate?: number[];
  truth?: number[];
  covariance?: number[] | null;
  coverage?: number | null;
  map_entropy?: number | null;
  trajectory_entropy?: number | null;
  kept?: number;
  loops?: number;
  collisions?: number;
  scan?: { first_angle?: number; angle_step?: number; max_range?: number; ranges: PackedPositions };
  poses?: number[][];
  removed_poses?: number[];
  edges?: number[][];
  removed_edges?: number[];
  map?: MapChangeJson;
  kind?: string;
  why?: string;
  candidates?: CandidateJson[];
  chosen?: number;
  notes?: string[];
  tree?: { count: number; positions: Positions; parents: NumberArray; values: Positions };
}

export interface ExplorationJson {
  name?: string;
  complete?: boolean;
  header?: ExplorationHeaderJson;
  lines: ExplorationLineJson[];
  /** Of a run that goes on: where further lines come from, `?from=N` those from number N on. */
  live?: string;
}

export interface ReportJson {
  format: string;
  version: number;
  kind: "view" | "bench";
  cairn?: string;
  title?: string;
  command?: string;
  created?: string;
  machine?: Machine;
  build?: Build;
  notes?: string[];
  graphs?: GraphJson[];
  explorations?: ExplorationJson[];
  bench?: BenchJson | null;
}
