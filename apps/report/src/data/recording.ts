// SPDX-License-Identifier: BSD-3-Clause
import type { FrameJson, RecordingJson } from "./contract";
import { DataError, decodeFloats, decodeIndices, decodePositions } from "./decode";

export interface Frame {
  label: string;
  iteration: number | null;
  time: number | null;
  chi2: number | null;
  seconds: number | null;
  variables: number;
  edges: number;
  changed: Int32Array | null;
  positions: Float32Array;
  edgeChi2: Float32Array | null;
}

const finite = (x: unknown): number | null => (typeof x === "number" && Number.isFinite(x) ? x : null);

const kCheckpointEvery = 32;

/**
 * What was recorded of a run. Frames hold what changed; `positions(k)` puts them together, from the frame
 * before when stepping forwards, else from the nearest checkpoint.
 */
export class Recording {
  private readonly checkpoints = new Map<number, Float32Array>();
  private readonly current: Float32Array;
  private at = -1;

  private constructor(
    readonly name: string,
    readonly kind: "iterations" | "time",
    readonly frames: Frame[],
    variables: number,
  ) {
    this.current = new Float32Array(3 * variables).fill(NaN);
  }

  static async decode(
    json: RecordingJson, dimension: 2 | 3, variables: number, edges: number, where: string,
  ): Promise<Recording> {
    if (!Array.isArray(json.frames) || json.frames.length === 0) throw new DataError(`${where}: no frames`);
    const frames: Frame[] = [];
    for (const [k, frame] of json.frames.entries()) {
      frames.push(await decodeFrame(frame, dimension, variables, edges, `${where}, frame ${k + 1}`));
    }
    const kind = json.kind === "time" ? "time" : "iterations";
    return new Recording(String(json.name ?? "recording"), kind, frames, variables);
  }

  /** x y z of every variable in frame `k`, NaN for those not there. Good until the next call. */
  positions(k: number): Float32Array {
    if (k < this.at || this.at < 0) this.rewind(k);
    while (this.at < k) this.step();
    return this.current;
  }

  private rewind(k: number): void {
    let from = Math.floor(k / kCheckpointEvery) * kCheckpointEvery;
    while (from > 0 && !this.checkpoints.has(from)) from -= kCheckpointEvery;
    const saved = this.checkpoints.get(from);
    if (saved) this.current.set(saved);
    else this.current.fill(NaN);
    this.at = saved ? from : -1;
  }

  private step(): void {
    const frame = this.frames[++this.at];
    if (frame.changed) {
      for (let j = 0; j < frame.changed.length; ++j) {
        const i = frame.changed[j];
        for (let d = 0; d < 3; ++d) this.current[3 * i + d] = frame.positions[3 * j + d];
      }
    } else {
      this.current.set(frame.positions);
    }
    this.current.fill(NaN, 3 * frame.variables);
    if (this.at % kCheckpointEvery === 0 && this.at > 0 && !this.checkpoints.has(this.at)) {
      this.checkpoints.set(this.at, this.current.slice());
    }
  }
}

async function decodeFrame(
  json: FrameJson, dimension: 2 | 3, variables: number, edges: number, where: string,
): Promise<Frame> {
  const present = Math.min(json.variables ?? variables, variables);
  const shown = Math.min(json.edges ?? edges, edges);
  const changed = json.changed ? await decodeIndices(json.changed, `${where}, changed`, 0, variables) : null;
  return {
    label: String(json.label ?? ""),
    iteration: finite(json.iteration),
    time: finite(json.time),
    chi2: finite(json.chi2),
    seconds: finite(json.seconds),
    variables: present,
    edges: shown,
    changed,
    positions: await decodePositions(json.positions, dimension, changed ? changed.length : present, where),
    edgeChi2: json.edge_chi2 ? await decodeFloats(json.edge_chi2, `${where}, edge_chi2`, shown) : null,
  };
}
