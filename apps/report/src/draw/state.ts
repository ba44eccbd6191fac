// SPDX-License-Identifier: BSD-3-Clause
import type { Theme } from "./colour";

/** What the reader has chosen to see. */
export interface ViewState {
  theme: Theme;
  /** Which estimates are shown. */
  shown: boolean[];
  /** The estimate whose edges, poses and ellipses are drawn. */
  focus: number;
  /** By edge class. */
  classes: boolean[];
  byResidual: boolean;
  poses: boolean;
  landmarks: boolean;
  headings: boolean;
  ellipses: boolean;
  /** Probability that an ellipse holds. */
  probability: number;
  /** By how much ellipses are drawn larger than they are. */
  magnify: number;
  grid: boolean;
  /** -1: none. */
  recording: number;
  /** Frame of the recording; between two, in between. */
  frame: number;
}

export type Hit = { kind: "variable" | "edge"; index: number; estimate: number };
